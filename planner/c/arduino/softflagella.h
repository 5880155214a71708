/* The motor of the robot and the schedule of its plan, for Arduino. */
#ifndef SOFTFLAGELLA_H
#define SOFTFLAGELLA_H
#include <Arduino.h>
#include "schedule.h"

/* A DC motor behind an H-bridge with two inputs: one carries the PWM, the other is low; both are low at rest. */
class Motor {
public:
    /* Pins with PWM of the input for direction +1 and of that for -1; duty 0 to 255. */
    Motor(uint8_t plus_pin, uint8_t minus_pin, uint8_t duty) : plus(plus_pin), minus(minus_pin), duty(duty) {}

    void begin()
    {
        pinMode(plus, OUTPUT);
        pinMode(minus, OUTPUT);
        analogWrite(plus, 0);
        analogWrite(minus, 0);
        direction = 0;
    }

    /* Turns in a direction, +1 or -1; 0 stops. */
    void turn(int8_t wanted)
    {
        if (wanted == direction) return;
        direction = wanted;
        analogWrite(wanted > 0 ? minus : plus, 0);
        analogWrite(wanted > 0 ? plus : minus, wanted ? duty : 0);
    }

private:
    uint8_t plus, minus, duty;
    int8_t direction = 0;
};

/* Follows schedule.h. Dwells begin where the one before ends, so late calls do not add up. */
class Schedule {
public:
    void begin(uint32_t now)
    {
        since = now;
        index = 0;
        direction = SCHEDULE_FIRST_DIRECTION;
    }

    /* The direction of the motor at a time of millis(), 0 after the end; call it at least once a millisecond. */
    int8_t at(uint32_t now)
    {
        while (direction != 0 && now - since >= schedule_dwell_ms(index)) {
            since += schedule_dwell_ms(index);
            direction = (int8_t)-direction;
            index++;
            if (index < SCHEDULE_COUNT) continue;
#ifdef SCHEDULE_REPEATS
            index = 0;
#else
            direction = 0;
#endif
        }
        return direction;
    }

private:
    uint32_t since = 0;
    int index = 0;
    int8_t direction = 0;
};
#endif
