"""stellated and stellate with the libraries that they need beside them, for packages that carry a server."""

from __future__ import annotations

import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
PROGRAMS = ("stellated", "stellate")
# What every machine has that a manylinux wheel is for: PEP 600 and its list of libraries.
OF_THE_MACHINE = re.compile(
    r"(linux-vdso|ld-linux[-\w]*|lib(c|m|dl|rt|pthread|stdc\+\+|gcc_s))\.so(\.\d+)*"
)


def must(*command: str | pathlib.Path, cwd: pathlib.Path = ROOT) -> str:
    """What a command prints; ends this program if the command fails."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True)
    if done.returncode:
        said = (done.stdout + done.stderr)[-3000:]
        sys.exit(f"packaging: {' '.join(map(str, command))} failed: {said}")
    return done.stdout


def fill(bundle: pathlib.Path) -> int:
    """Builds the programs, and puts them, their libraries in lib/, and all licences into `bundle`.

    They run from wherever it lies. Returns N, where they need glibc 2.N.
    """
    must(ROOT / "packaging" / "build", "programs")
    (bundle / "lib").mkdir(parents=True)
    for program in (ROOT / "build/package/bin" / name for name in PROGRAMS):
        shutil.copy(program, bundle)
        for name, path in re.findall(r"(\S+) => (\S+)", must("ldd", program)):
            if path == "not":
                sys.exit(f"packaging: {name}, which {program.name} links, is not found")
            if not OF_THE_MACHINE.fullmatch(name) and not (bundle / "lib" / name).exists():
                shutil.copy(path, bundle / "lib" / name)
                keep_licence(pathlib.Path(path), bundle / "licences")
    shutil.copy(ROOT / "LICENSE", bundle / "licences" / "stellate")
    shutil.copy(ROOT / "build/grpc/LICENSE", bundle / "licences" / "grpc")
    files = [
        file for file in bundle.rglob("*") if file.is_file() and file.parent.name != "licences"
    ]
    for file in files:
        must("strip", "--strip-unneeded", file)
        # Before $LD_LIBRARY_PATH, which is for other programs of the user's.
        beside = "$ORIGIN" if file.parent.name == "lib" else "$ORIGIN/lib"
        must("patchelf", "--force-rpath", "--set-rpath", beside, file)
    return max(map(glibc_of, files))


def glibc_of(file: pathlib.Path) -> int:
    """N of the newest 2.N whose symbols it wants."""
    found = re.findall(r"GLIBC_2\.(\d+)", must("objdump", "-T", file))
    return max(map(int, found), default=17)


def keep_licence(library: pathlib.Path, folder: pathlib.Path) -> None:
    """Debian's file about the package that a library is of."""
    folder.mkdir(exist_ok=True)
    real = library.resolve()
    # /lib is /usr/lib, and dpkg knows either.
    package = must("dpkg", "-S", f"*/{real.parent.name}/{real.name}").split(":")[0]
    text = pathlib.Path("/usr/share/doc") / package / "copyright"
    if not text.exists():
        sys.exit(f"packaging: Debian says nothing of the licence of {package}")
    shutil.copy(text, folder / package)
