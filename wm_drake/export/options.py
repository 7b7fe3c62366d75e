"""How an FMU is written: options of the command and of `export_fmu`."""

from pydantic import BaseModel, ConfigDict, Field


class FmuOptions(BaseModel):
    """How an FMU is written.

    Attributes:
        fmi: Version of the standard.
        input: What drives the drum: speed or torque.
        platform: Names of platforms, separated by commas; that of this computer if empty.
        step: Largest step of the integrator; that of the machine if None. [s]
        no_gasket: Whether the gasket is taken out.
        sources: Whether the FMU also has its sources, which GCC and Clang compile.

    Example:
        >>> import wm_drake as wm
        >>> wm.FmuOptions(fmi=2, input="torque").fmi
        2
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    fmi: int = Field(3, description="Version of the standard, 2 or 3.")
    input: str = Field("speed", description="What drives the drum: speed or torque.")
    platform: str = Field(
        "",
        description="Platforms, separated by commas: linux64, win64, darwin64, aarch64. Default: "
        "that of this computer. Others need the package ziglang.",
        json_schema_extra={"metavar": "NAMES"},
    )
    step: float | None = Field(
        None,
        description="Largest step of the integrator. Default: that of the machine.",
        json_schema_extra={"metavar": "SECONDS"},
    )
    no_gasket: bool = Field(False, description="Take the gasket out.")
    sources: bool = Field(False, description="Add sources that GCC and Clang compile.")
