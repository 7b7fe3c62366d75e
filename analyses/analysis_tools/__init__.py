"""What several analyses share: published numbers beside ours with a verdict, changed machines.

`validation_rows`, `claims`, `gasket_study` and `validation_page` compare with papers;
`sdf_text` writes fitted numbers into an SDF, `damper_topology` takes tubes out of a machine.
"""
