"""A pretended board, for CPython and MicroPython: it prints milliseconds, pin and duty at each change of a pin.

    board.py FUNCTION FIRST[:RESTART[:plain]] LATE UNTIL [TIME ORDERS]…

The clock begins at FIRST and starts anew at RESTART, or 2**30, as those of most boards; plain: differences of its
times do not wrap. A sleep takes up to LATE ms more. At
UNTIL comes Ctrl-C. From the serial port come ORDERS at their times.
"""

import sys

PERIOD = 1 << 30
function, clock_words, late, until, *words = sys.argv[1:]
first, restart, plain, *_ = (clock_words + "::").split(":")
orders = [(int(time), order) for time, text in zip(words[::2], words[1::2]) for order in text]  # noqa: B905
pins = {}


def at_once(ms):
    assert abs(ms) < PERIOD // 2
    return ms


class Ticks:
    def __init__(self):
        self.now = 0

    def ticks_ms(self):
        return (int(first) + self.now) % int(restart or PERIOD)

    def ticks_add(self, ticks, ms):
        assert 0 <= ticks < PERIOD
        return (ticks + at_once(ms)) % PERIOD

    def ticks_diff(self, end, start):
        assert 0 <= start < PERIOD
        assert 0 <= end < PERIOD
        if plain:
            return end - start
        return (end - start + PERIOD // 2) % PERIOD - PERIOD // 2

    def sleep_ms(self, ms):
        self.now += at_once(ms) + self.now * 7 % (int(late) + 1)
        if self.now >= int(until):
            self.now = int(until)
            raise KeyboardInterrupt

    def sleep(self, seconds):
        self.sleep_ms(1000 * seconds)


class Pulses:
    def __init__(self, pin, freq, duty_u16):
        self.pin = pin
        self.duty_u16(duty_u16)

    def duty_u16(self, duty):
        if pins.get(self.pin) != duty:
            pins[self.pin] = duty
            print(clock.now, self.pin, duty)


class Machine:
    PWM = Pulses

    def Pin(self, number):
        return number


class Serial:
    POLLIN = 1

    @property
    def stdin(self):
        return self

    def poll(self, ms=None):
        if ms is None:
            return self
        wait = min(ms, orders[0][0] - clock.now if orders else ms)
        if wait > 0:
            clock.sleep_ms(wait)
        return orders and orders[0][0] <= clock.now

    def register(self, port, event):
        pass

    def read(self, count):
        return orders.pop(0)[1]


clock, serial = Ticks(), Serial()
sys.modules.update({"time": clock, "machine": Machine(), "select": serial, "sys": serial})
sys.path.insert(0, ".")
try:
    getattr(__import__("motor"), function)()
except KeyboardInterrupt:
    print(clock.now, "Ctrl-C", 0)
