"""What the server keeps for each thread lies on its stack, of which a library's threads may have
100 KB (civetweb's, which answer scrapes): large scratch belongs on the heap.

    thread_memory_test.py PROGRAM
"""

import struct
import sys
from pathlib import Path

MOST = 32 * 1024  # bytes
PT_TLS = 7


def thread_memory(program: Path) -> int:
    """Bytes of static memory a thread, of an ELF file of 64 bits."""
    image = program.read_bytes()
    if image[:6] != b"\x7fELF\x02\x01":
        raise ValueError(f"{program} is no little-endian ELF file of 64 bits")
    (headers,) = struct.unpack_from("<Q", image, 32)
    size, count = struct.unpack_from("<HH", image, 54)
    for i in range(count):
        kind, _, _, _, _, _, in_memory, _ = struct.unpack_from(
            "<IIQQQQQQ", image, headers + i * size
        )
        if kind == PT_TLS:
            return in_memory
    return 0


def main() -> None:
    size = thread_memory(Path(sys.argv[1]))
    print(f"{size} bytes a thread, at most {MOST}")
    sys.exit(not 0 < size <= MOST)


if __name__ == "__main__":
    main()
