"""Names that Windows keeps for devices: no file there can be called so, with or without an ending."""

DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))})


def is_device(name: str) -> bool:
    """Whether the name of a file or folder stands for a device."""
    return name.partition(".")[0].lower() in DEVICES


def no_device(name: str) -> str:
    """Return `name`, or a name near to it that stands for no device."""
    return f"_{name}" if is_device(name) else name
