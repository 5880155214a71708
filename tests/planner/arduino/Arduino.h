/* What the sketches need of Arduino's core: declarations; tests/planner/arduino/board.cpp pretends a board on a PC. */
#ifndef ARDUINO_H
#define ARDUINO_H
#include <stdint.h>
#define HIGH 1
#define LOW 0
#define OUTPUT 1
#define LED_BUILTIN 13
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t value);
void analogWrite(uint8_t pin, int value);
unsigned long millis(void);
void delay(unsigned long ms);
class SerialPort {
public:
    void begin(unsigned long baud);
    int available(void);
    int read(void);
};
extern SerialPort Serial;
#endif
