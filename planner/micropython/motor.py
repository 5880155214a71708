"""The robot's motor behind an H-bridge: first_turn(), swim(), obey(); each takes a function for another driver."""

import select
import sys
import time

import schedule
from machine import PWM, Pin

PLUS_PIN, MINUS_PIN = 14, 15  # inputs for directions +1 and -1: one carries the PWM, the other is low
DUTY = 65535  # of the PWM, 0 to 65535: set it so that the motor has the speed of the plan
LATEST_MS = 65536  # a flip that is later is none
DIRECTIONS = {"F": 1, "B": -1, "S": 0}

plus, minus = (PWM(Pin(pin), freq=1000, duty_u16=0) for pin in (PLUS_PIN, MINUS_PIN))


def turn(direction):
    """Turn in a direction, +1 or -1; 0 stops."""
    (minus if direction > 0 else plus).duty_u16(0)
    (plus if direction > 0 else minus).duty_u16(DUTY if direction else 0)


def first_turn(turn=turn):
    """Wait 5 s, turn at +1 for 5 s: seen from above, the robot must turn left; else exchange the motor's wires."""
    try:
        time.sleep(5)
        turn(1)
        time.sleep(5)
    finally:
        turn(0)


def entry(index):
    """Return an entry of schedule.py in ms."""
    return schedule.ENTRIES[2 * index] | schedule.ENTRIES[2 * index + 1] << 8


def swim(turn=turn):
    """Carry out the schedule; stop at its end, at an error and at Ctrl-C.

    A dwell begins where the one before ends, so late flips do not add up. Where a dwell has several entries, each
    shorter than 66 s, `turn` is called again with the same direction. No wait is longer than its entry.
    """
    if sum(map(entry, range(schedule.COUNT))) != schedule.TOTAL_MS:
        raise ValueError("schedule.py is damaged; copy it again")
    direction, flip = schedule.FIRST_DIRECTION, time.ticks_ms()
    try:
        while direction:
            for ms in map(entry, range(schedule.COUNT)):
                if ms:
                    turn(direction)
                flip = time.ticks_add(flip, ms)
                while True:
                    now = time.ticks_ms()
                    wait = time.ticks_diff(flip, now)
                    if not -LATEST_MS < wait <= ms:  # the clock began anew where ticks_diff does not expect it
                        flip, wait = time.ticks_add(now, ms), ms
                    if wait <= 0:
                        break
                    time.sleep_ms(wait)
                direction = -direction
            if not schedule.REPEATS:
                direction = 0
    finally:
        turn(0)


def obey(turn=turn):
    """Obey a computer that tracks the robot: letters F, B, S; after a second of silence the motor stops."""
    orders, heard = select.poll(), time.ticks_ms()
    orders.register(sys.stdin, select.POLLIN)
    try:
        while True:
            order = sys.stdin.read(1) if orders.poll(100) else ""
            if order in DIRECTIONS:
                turn(DIRECTIONS[order])
                heard = time.ticks_ms()
            elif not 0 <= time.ticks_diff(time.ticks_ms(), heard) < 1000:
                turn(0)
    finally:
        turn(0)
