import pathlib

# Of the source tree's VERSION file; _stubs.py puts it there.
__version__ = (
    (pathlib.Path(__file__).parent / "_generated" / "VERSION").read_text(encoding="ascii").strip()
)
