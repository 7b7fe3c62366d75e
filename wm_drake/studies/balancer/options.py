"""Options of the study of balancers, and its declaration."""

from wm_drake.studies.study import Options, Study, imported, option


class BalancerOptions(Options):
    """Options of the study of balancers."""

    machine: str = option("ball_rings", "Name of a shipped machine, or machine file.", "NAME|FILE")
    balls: str = option(
        "ball_rings",
        "Machine whose rings of balls are fitted if that of --machine has none.",
        "NAME|FILE",
    )
    liquid: str = option(
        "liquid_rings",
        "Machine whose rings of liquid are fitted if that of --machine has none.",
        "NAME|FILE",
    )
    mass: str = option("0.15,0.3,0.5,0.7 kg", "Unbalance masses at the wall.", "MASSES")
    place: str = option(
        "-110,-55,0,55,110 mm",
        "Places of the unbalance along the drum, to the rear from its mid-depth.",
        "LENGTHS",
    )
    ball_mass: str = option(
        "25,50,100,150 %", "Masses of the balls, of those of the file.", "PARTS"
    )
    damping: str = option(
        "3,10,30,100,300 %", "Dampings of the races, of those of the file.", "PARTS"
    )
    release: str = option(
        "200,250,300,400,600 rpm",
        "Speeds at which locked balls are released in further runs.",
        "SPEEDS",
    )
    high: str | None = option(
        None, "Highest speed. Default: that of the spin profile of the machine.", "SPEED", "--to"
    )
    rate: str = option("20 rpm/s", "Rate of the run-up.", "RATE")


BALANCER = Study(
    "balancer",
    "Say which balancer to fit: none, rings of balls or of liquid; where balls hurt and pay.",
    BalancerOptions,
    imported("wm_drake.studies.balancer.task:BalancerTask"),
    quick={
        "mass": "0.4 kg",
        "place": "0,110 mm",
        "ball_mass": "100 %",
        "damping": "30,100 %",
        "release": "300 rpm",
        "high": "400 rpm",
        "rate": "40 rpm/s",
    },
)
