"""Session with the DSACON32m: read its type and matrices, and start its images."""

from __future__ import annotations

from slipd.devices.dsacon32 import dsacon32_messages as messages
from slipd.devices.dsacon32.dsacon32_decoder import MAX_MATRICES, Decoder, matrices_problem
from slipd.devices.shared.integer_option import check_integer
from slipd.devices.shared.startup_sequence import ANSWER_NS
from slipd.devices.shared.weiss_tactile import Query, TactileSession

MAX_RATE_HZ = 30
"""Highest rate of the controller."""

BOOT_NS = 9_000_000_000
"""Time allowed for booting; the controller ignores requests for about 8 s after power-up."""


class Session(TactileSession):
    """Read controller type and matrices, and start the images.

    In addition to the states of `TactileSession`, `state` may be "controller not operable", or that the controller's
    type has an unknown image format; such a controller is not started. `identity` is the controller's serial number.

    Args:
        rate_hz: Images per second, 1 to 30.
        rle: Whether to request run-length encoded images; a plain one of an SDH hand takes 85 ms at 115200 bit/s.

    Raises:
        ValueError: The rate is out of range or not an integer.
    """

    decoder: Decoder

    def __init__(self, rate_hz: int = MAX_RATE_HZ, rle: bool = True) -> None:
        check_integer("rate_hz", rate_hz, 1, MAX_RATE_HZ)
        stop, start = messages.acquire(0, rle=rle), messages.acquire(rate_hz, rle=rle)
        queries = [
            Query(
                "controller",
                messages.encode_query(messages.CONTROLLER),
                attempts=BOOT_NS // ANSWER_NS,
                reply_id=messages.CONTROLLER,
                handle=self._handle_controller,
            ),
            Query(
                "sensor",
                messages.encode_query(messages.SENSOR),
                reply_id=messages.SENSOR,
                handle=self._handle_sensor,
            ),
            Query("stop", stop, reply_id=messages.ACQUIRE, tolerates=range(1, 1 << 16)),
            Query("start", start, reply_id=messages.ACQUIRE, tolerates=(messages.ALREADY_RUNNING,)),
        ]
        super().__init__(Decoder(), queries, stop, messages.ERROR_WORDS, 1_000_000_000 // rate_hz)
        self._matrices: list[tuple[int, int]] = []
        self._expected = 0

    def _handle_controller(self, payload: bytes) -> str:
        info = messages.parse_controller(payload)
        if info.kind != messages.TYPE_DSACON32:
            return f"the controller must be a DSACON32, got type {info.kind_name}"
        self.identity = f"S/N {info.serial}"
        return "" if info.operable else "controller not operable"

    def _handle_sensor(self, payload: bytes) -> str:
        count = messages.parse_sensor(payload)
        if not 1 <= count <= MAX_MATRICES:
            return f"a controller must have 1 to {MAX_MATRICES} matrices, got {count}"
        self._matrices = []
        self._expected = count
        self._queries[2:-2] = [
            Query(
                f"matrix {index}",
                messages.encode_matrix_query(index),
                reply_id=messages.MATRIX,
                handle=self._handle_matrix,
            )
            for index in range(count)
        ]
        return ""

    def _handle_matrix(self, payload: bytes) -> str:
        matrices = [*self._matrices, messages.parse_matrix(payload)]
        problem = matrices_problem(matrices)
        if not problem:
            self._matrices = matrices
            if len(matrices) == self._expected:
                self.decoder.set_matrices(matrices)
        return problem
