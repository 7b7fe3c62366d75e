"""What several analyses share: published numbers beside ours with a verdict, changed machines.

`validation_rows`, `claims`, `gasket_study` and `validation_page` compare with papers;
`goals` says how near a machine is to [B]; `machine_net`, `net_measures` and `net_ledger` draw and
score machines, `machine_fit` fits them; `error_causes` has those of [A]; `spin_profiles` are short;
`sdf_text` writes fitted numbers into an SDF, `damper_topology` takes tubes out of a machine.
"""
