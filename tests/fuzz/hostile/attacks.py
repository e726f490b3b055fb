"""What strangers may try on a server. Each attack ends by itself, or raises when the server hangs.

An attack knows only its own meshes: the names of others' cannot be guessed.
"""

from __future__ import annotations

from typing import Callable

import connection_attacks
import message_attacks
from target import Target

ATTACKS: tuple[Callable[[Target], None], ...] = (
    message_attacks.random_messages,
    message_attacks.mutated_messages,
    message_attacks.wrong_order,
    message_attacks.leases,
    message_attacks.giant_shapes,
    connection_attacks.half_open,
    connection_attacks.floods,
    connection_attacks.rapid_resets,
    connection_attacks.unbounded_calls,
    message_attacks.packed_messages,
    connection_attacks.unread_replies,
    connection_attacks.endless_headers,
    connection_attacks.half_messages,
    connection_attacks.bad_headers,
    connection_attacks.other_protocols,
    connection_attacks.deaf_watchers,
    connection_attacks.silent_watchers,
    connection_attacks.made_and_cancelled,
)
