"""What runs on one thread alone, however many there are.

    tests/bench/run serial [MANIFOLD EPSILON]... [--functions N]

Counts instructions by callgrind, so no clock and no load matters: of one thread inside of Absorb,
those outside of all parallel loops, by function. What the C and C++ libraries take is counted with
the functions that call them. Without arguments: the torus and SO(3) of docs/evidence/scale.md.
"""

from __future__ import annotations

import argparse
import collections
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "build/release/bin/serial"
CASES = ["torus:1:0.4", "0.00525", "so3", "0.225"]
OURS = "stellate::"


class Profile:
    """The instructions of a callgrind.out file: of each function alone, and of its calls."""

    def __init__(self, path: pathlib.Path) -> None:
        self._names: dict[str, str] = {}
        self.own: collections.Counter[str] = collections.Counter()
        self.calls: collections.Counter[tuple[str, str]] = collections.Counter()
        function = callee = ""
        is_call = False
        for line in path.read_text().splitlines():
            key, _, value = line.partition("=")
            if key == "fn":
                function = self._name(value)
            elif key == "cfn":
                callee = self._name(value)
            elif key == "calls":
                is_call = True
            elif line[:1] in tuple("0123456789+-*"):
                cost = int((line.split() + ["0"])[1])
                if is_call:
                    self.calls[function, callee] += cost
                else:
                    self.own[function] += cost
                is_call = False

    def _name(self, text: str) -> str:
        """Names come once, as "(7) name", and then as "(7)"."""
        match = re.fullmatch(r"\((\d+)\)(?: (.*))?", text)
        if not match:
            return text
        if match[2]:
            self._names[match[1]] = match[2].partition("'")[0]  # without the depth of recursion
        return self._names[match[1]]

    @property
    def total(self) -> int:
        return sum(self.own.values())

    def by_own_functions(self) -> collections.Counter[str]:
        """Counts what other libraries take with those of our functions that call them."""
        callers = collections.defaultdict(list)
        for (caller, callee), cost in self.calls.items():
            if caller != callee and cost:
                callers[callee].append((caller, cost))
        found: collections.Counter[str] = collections.Counter()
        left = collections.Counter(self.own)
        for _ in range(50):  # steps up the stack
            above: collections.Counter[str] = collections.Counter()
            for function, cost in left.items():
                over = sum(c for _, c in callers[function])
                if OURS in function or not over:
                    found[function] += cost
                else:
                    for caller, part in callers[function]:
                        above[caller] += cost * part / over
            left = above
        return found


def measure(manifold: str, epsilon: str) -> tuple[Profile, Profile, str]:
    """Everything and the serial part, side by side, and the number of vertices."""
    with tempfile.TemporaryDirectory() as directory:
        running = []
        for what in ("all", "serial"):
            out = pathlib.Path(directory, what)
            command = ["valgrind", "--tool=callgrind", "--collect-atstart=no", "-q",
                       f"--callgrind-out-file={out}", PROGRAM, what, manifold, epsilon]  # fmt: skip
            running.append((out, subprocess.Popen(command, stdout=subprocess.PIPE, text=True)))
        vertices = [process.communicate()[0].strip() for _, process in running]
        if any(process.returncode for _, process in running):
            sys.exit(f"serial: {manifold} {epsilon} was not meshed, or not certified")
        whole, serial = (Profile(out) for out, _ in running)
    return whole, serial, vertices[0]


def brief(name: str) -> str:
    """A function's name without what it takes."""
    name = re.sub(r"\[clone [^]]*\]|stellate::core::|\(anonymous namespace\)::", "", name)
    while (shorter := re.sub(r"<[^<>]*>", "", name)) != name:
        name = shorter
    parts = re.sub(r"\([^()]*\)( const)?", "()", re.sub(r"\{lambda[^}]*\}", "lambda", name))
    return parts.strip()[:90]


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="tests/bench/run serial",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("cases", nargs="*", metavar="MANIFOLD EPSILON")
    parser.add_argument("--functions", type=int, default=25, help="how many are listed (25)")
    arguments = parser.parse_args()
    cases = arguments.cases or CASES
    if len(cases) % 2:
        parser.error("give an epsilon with each manifold")
    for manifold, epsilon in zip(cases[::2], cases[1::2], strict=True):
        whole, serial, vertices = measure(manifold, epsilon)
        print(
            f"{manifold} {epsilon}: {vertices} vertices, {whole.total:,} instructions, "
            f"{serial.total:,} of them serial: {100 * serial.total / whole.total:.2f} %"
        )
        functions: collections.Counter[str] = collections.Counter()
        for function, cost in serial.by_own_functions().items():
            functions[brief(function)] += cost
        for function, cost in functions.most_common(arguments.functions):
            print(f"{100 * cost / whole.total:8.2f} %  {function}")
        print(flush=True)


if __name__ == "__main__":
    main()
