"""Drawing of a machine's diagram as text."""

from pydrake.systems.framework import Diagram


def mermaid(diagram: Diagram) -> str:
    """Return a Mermaid flow chart of the systems of a diagram and the signals between them."""
    systems = diagram.GetSystems()
    lines = ["flowchart LR"]
    for system in systems:
        kind = type(system).__name__.split("_")[0]
        if hasattr(system, "kind"):  # one system serves elements of all kinds
            kind = system.kind.title
        lines.append(
            f'  {system.get_name()}["{system.get_name().replace("_", " ")}<br/><i>{kind}</i>"]'
        )
    arrows = []
    for (to_system, to_port), (from_system, from_port) in diagram.connection_map().items():
        port = from_system.get_output_port(from_port)
        into = to_system.get_input_port(to_port).get_name().replace("_", " ")
        label = (
            port.get_name().replace("_", " ") if port.get_name().startswith("generalized") else into
        )
        arrows.append(f"  {from_system.get_name()} -- {label} --> {to_system.get_name()}")
    return "\n".join(lines + sorted(arrows))
