"""How an FMU is written: options of the command and of `export_fmu`."""

from pydantic import BaseModel, ConfigDict, Field


class FmuOptions(BaseModel):
    """How an FMU is written; the step is in s.

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
