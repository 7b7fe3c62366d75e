"""Which numbers of the door gasket decide how the tub moves, and what load it passes on ([B] 4)?

An SDF file has the bodies, a machine file the forces. Together they become a Drake diagram: a
MultibodyPlant, a LeafSystem for each spring, friction damper and bushing, whose forces act on the
plant, and a speed source that turns the drum. Eight numbers of the gasket vary at three levels. A
D-optimal design chooses the trials; each is a run-up with each load. Analysis of variance divides
the variance of each response among the factors and their pairs, beside what [B] prints.

The compiled engine runs a trial in milliseconds. `--engine drake` runs the diagram itself in
pydrake's Simulator, for some seconds a run, with the same results.
"""

import argparse
import time
from pathlib import Path

import wm_drake as wm

LOADS = ("middle", "counter")
"""Loads of [B] section 4: 1 kg in the middle of the drum; 0.5 kg at each end, opposite."""

BOTH = 150
"""Trials from which on pairs of factors are estimated too: then the model has 129 coefficients."""

LEADING = 10.0
"""Contribution above which a term is printed. [%]"""


def main() -> None:
    """Run the design and print the contributions."""
    options = parsed()

    # bodies (SDF) and forces (machine file) -> MultibodyPlant and LeafSystems in one diagram
    machine = wm.build_machine(options.machine)
    text = f"{machine.parameters.name}: {machine.parameters.model}\n"
    for system in machine.diagram.GetSystems():
        text += f"  {system.get_name():20} {type(system).__name__}\n"

    # eight factors at 50 %, 100 % and 150 % of the machine file, and the trials
    factors = wm.factors(machine.parameters)
    model = "main+2fi" if options.trials >= BOTH else "main"
    design = wm.make_design("d-optimal", factors.names, trials=options.trials, model=model)
    text += f"{design.trials} trials for {design.coefficients} coefficients ({model}), "
    text += f"D-efficiency {design.efficiency():.1f} %\n"

    # each trial with each load: largest displacement D, force F and moment M, smallest gap
    begin = time.perf_counter()
    with wm.progress_bar(design.trials * len(options.loads)) as progress:
        trials = wm.run_trials(
            factors, design, options.loads, engine=options.engine, progress=progress
        )
    text += f"{options.engine} engine: {time.perf_counter() - begin:.1f} s\n"

    # share of each term in the variance of each response, beside the printed ones
    analysis = wm.anova(trials)
    shares = wm.contributions(analysis)
    is_leading = shares.filter(like="contribution").max(axis=1) > LEADING
    text += shares[is_leading].round(1).to_string(index=False)

    print(text)
    if options.out:
        options.out.write_text(text + "\n")
        wm.doe_report(analysis).save(options.out.with_suffix(""))


def parsed() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="reference", help="name or file of a machine")
    parser.add_argument("--engine", default="compiled", choices=("compiled", "drake"))
    parser.add_argument("--trials", type=int, default=1000, help="number of trials")
    parser.add_argument("--quick", action="store_true", help="20 trials with one load")
    parser.add_argument("--out", type=Path, help="write the table to this file, and the report")
    options = parser.parse_args()
    options.loads = LOADS
    if options.quick:
        options.trials, options.loads = 20, LOADS[:1]
    return options


if __name__ == "__main__":
    main()
