"""One link as a state machine: order, deadlines, retries, silence, counters, lost ports."""

from __future__ import annotations

import pytest

from drivers.errors import DeviceTimeout, DriverError, ExceptionReply, FrameError, PortError
from drivers.wire import MAX_QUIET_S, QUIET_AFTER_FAULT_S, Exchange, Pause, Steps, call, complete, open_port
from tests.drivers.scripted import Reply, port_of, scripted_link


def echo(text: bytes, *, timeout_s: float = 0.1, repeatable: bool = True) -> Exchange[bytes]:
    """A request whose reply is three bytes: anything but `!`-frames is good."""

    def length(buffer: bytearray) -> int:
        if buffer[:1] == b"?":
            raise FrameError("motor", "no reply begins so")
        return 3

    def parse(frame: bytes, _sent_s: float, _received_s: float) -> bytes:
        if frame == b"bad":
            raise FrameError("motor", "bad frame")
        if frame == b"no!":
            raise ExceptionReply("motor", "refused", code=2)
        return frame

    return Exchange("echo", text, length, parse, timeout_s, repeatable)


def test_a_reply_in_pieces_is_taken_with_its_last_byte() -> None:
    link = scripted_link([(b"one", [(0.010, b"O"), (0.020, b"N"), (0.035, b"E")])])
    exchange = echo(b"one")
    assert call(exchange, link) == b"ONE"
    assert exchange.received_s == pytest.approx(0.035)
    assert (link.traffic.bytes_out, link.traffic.bytes_in, link.traffic.exchanges) == (3, 3, 1)


def test_a_request_is_repeated_three_times_then_the_first_cause_is_told() -> None:
    link = scripted_link([(b"one", None)] * 3)
    with pytest.raises(DeviceTimeout, match="no answer to 'echo' within 100 ms"):
        call(echo(b"one"), link)
    assert port_of(link).finished
    assert (link.traffic.timeouts, link.traffic.retries, link.traffic.exchanges) == (3, 2, 0)


def test_what_must_not_be_sent_twice_is_sent_once() -> None:
    for reply in (None, b"bad", b"?"):
        link = scripted_link([(b"one", reply)])
        with pytest.raises((DeviceTimeout, FrameError)):
            call(echo(b"one", repeatable=False), link)
        assert link.traffic.retries == 0


def test_a_broken_frame_is_asked_for_again_after_a_silence() -> None:
    link = scripted_link([(b"one", [(0.001, b"bad")]), (b"one", b"ONE")])
    exchange = echo(b"one")
    assert call(exchange, link) == b"ONE"
    assert exchange.sent_s == pytest.approx(0.001 + QUIET_AFTER_FAULT_S)
    assert (link.traffic.bad_frames, link.traffic.retries, link.traffic.stray_bytes) == (1, 1, 3)


def test_a_refusal_is_final_and_counted() -> None:
    link = scripted_link([(b"one", b"no!")])
    with pytest.raises(ExceptionReply) as caught:
        call(echo(b"one"), link)
    assert caught.value.code == 2
    assert (link.traffic.refusals, link.traffic.retries, link.traffic.exchanges) == (1, 0, 1)


def test_a_late_reply_is_thrown_away_and_the_silence_counts_from_its_end() -> None:
    late: Reply = [(0.1005, b"L"), (0.1015, b"A"), (0.1025, b"T")]
    link = scripted_link([(b"one", late), (b"one", b"ONE")])
    exchange = echo(b"one")
    assert call(exchange, link) == b"ONE"
    assert exchange.sent_s == pytest.approx(0.1025 + QUIET_AFTER_FAULT_S)
    assert link.traffic.stray_bytes == 3


def test_a_line_that_never_falls_silent_is_spoken_to_all_the_same() -> None:
    chatter: Reply = [(0.1 + 0.001 * step, b"~") for step in range(1, 500)]
    link = scripted_link([(b"one", chatter), (b"one", b"ONE")])
    exchange = echo(b"one")
    link.submit(exchange)
    clock = link.clock
    while exchange.attempts < 2:
        clock.wait([link.port], link.wake_at())
        link.service()
    assert exchange.sent_s == pytest.approx(0.1 + MAX_QUIET_S, abs=0.002)


def test_urgent_goes_before_what_waits_and_the_queue_can_be_dropped() -> None:
    link = scripted_link([(b"one", b"ONE"), (b"hot", b"HOT"), (b"two", b"TWO")])
    one, two, hot = echo(b"one"), echo(b"two"), echo(b"hot")
    link.submit(one)
    link.submit(two)
    link.submit(hot, urgent=True)
    call_done = [link.submit(echo(b"never"))]
    link.drop_queue()
    assert not call_done[0].done
    link.submit(hot, urgent=True)
    link.submit(two)
    while not two.done:
        link.clock.wait([link.port], link.wake_at())
        link.service()
    assert (one.result(), hot.result(), two.result()) == (b"ONE", b"HOT", b"TWO")


def test_the_gap_is_kept_before_the_next_request() -> None:
    link = scripted_link([(b"one", [(0.01, b"ONE")]), (b"two", b"TWO")], gap_s=0.005)
    second = echo(b"two")
    link.submit(echo(b"one"))
    call(second, link)
    assert second.sent_s == pytest.approx(0.015)


def test_bytes_at_the_front_that_belong_to_nobody_are_counted_as_stray() -> None:
    def length(buffer: bytearray) -> int:
        while buffer[:1] == b"~":
            del buffer[:1]
        return 3

    link = scripted_link([(b"one", b"~~ONE")])
    assert call(Exchange("one", b"one", length, lambda frame, _s, _r: frame, 0.1), link) == b"ONE"
    assert link.traffic.stray_bytes == 2


def test_bytes_behind_a_reply_go_to_the_listener_or_count_as_stray() -> None:
    heard: list[bytes] = []
    link = scripted_link([(b"one", b"ONEmore"), (b"two", b"TWOmore")])
    call(echo(b"one"), link)
    link.listener = lambda data, _received_s: heard.append(data)
    call(echo(b"two"), link)
    assert link.traffic.stray_bytes == 4
    assert heard == [b"more"]


def test_a_lost_port_ends_everything_with_its_first_cause() -> None:
    link = scripted_link([(b"one", None)])
    in_flight, queued = echo(b"one"), echo(b"two")
    link.submit(in_flight)
    link.submit(queued)
    port_of(link).error = OSError(5, "Input/output error")
    link.service()
    link.close()
    later = link.submit(echo(b"three"))
    for exchange in (in_flight, queued, later):
        with pytest.raises(PortError, match="Input/output error"):
            exchange.result()


def test_a_port_that_was_unplugged_reads_as_silent_but_is_found_out() -> None:
    class Unplugged(type(port_of(scripted_link([])))):  # type: ignore[misc]
        @property
        def in_waiting(self) -> int:
            raise OSError(5, "Input/output error")

    link = scripted_link([])
    port_of(link).__class__ = Unplugged
    link.service()
    assert isinstance(link.broken, PortError)


def test_steps_get_values_errors_and_pauses() -> None:
    link = scripted_link([(b"one", b"ONE"), (b"two", b"no!"), (b"thr", b"THR")])

    def conversation() -> Steps[tuple[bytes, int | None, bytes, float]]:
        first = yield echo(b"one")
        try:
            yield echo(b"two")
            code = None
        except ExceptionReply as error:
            code = error.code
        before_s = link.clock.now()
        yield Pause(0.25)
        third = yield echo(b"thr")
        return first, code, third, link.clock.now() - before_s

    first, code, third, waited_s = complete(conversation(), link)
    assert (first, code, third) == (b"ONE", 2, b"THR")
    assert waited_s >= 0.25


def test_an_error_that_steps_do_not_catch_comes_out() -> None:
    link = scripted_link([(b"one", b"no!")])

    def conversation() -> Steps[bytes]:
        return (yield echo(b"one"))

    with pytest.raises(DriverError, match="motor: refused"):
        complete(conversation(), link)


@pytest.mark.parametrize("url", ["/dev/no-such-port", "nonsense://here", "socket://127.0.0.1:1"])
def test_a_port_that_is_not_there_is_named_with_the_cure(url: str) -> None:
    with pytest.raises(PortError) as caught:
        open_port("load_cell", url, 115200)
    assert url in str(caught.value)
    assert "check 'port' in the bench file" in str(caught.value)
