"""What several analyses share: published numbers beside ours with a verdict, changed machines.

`validation_rows`, `claims` and `validation_page` make the pages that compare with papers;
`sdf_text` writes fitted numbers into an SDF, `damper_topology` takes tubes out of a machine.
"""
