/* A board with a clock that a sketch runs on: board TOTAL FIRST STEP [TIME TEXT]... prints what happens at its pins.
 *
 * Times are in ms. The clock begins at FIRST; each loop takes STEP. TEXT comes in by the serial port at TIME. Lines
 * are the time since the start, the pin, and its value where it changes. */
#include <stdio.h>
#include <stdlib.h>
#include <map>
#include <string>
#include <Arduino.h>
void setup();
void loop();

static uint32_t first, since;
static std::map<int, int> values;
static std::map<uint32_t, std::string> script;
static std::string heard;
static unsigned long baud;
SerialPort Serial;

void pinMode(uint8_t, uint8_t) {}
void analogWrite(uint8_t pin, int value)
{
    if (values.count(pin) && values[pin] == value) return;
    values[pin] = value;
    printf("%u %d %d\n", (unsigned)since, pin, value);
}
void digitalWrite(uint8_t pin, uint8_t value) { analogWrite(pin, value); }
unsigned long millis() { return (uint32_t)(first + since); }
void delay(unsigned long ms) { since += (uint32_t)ms; }
void SerialPort::begin(unsigned long rate) { baud = rate; }
int SerialPort::available() { return baud == 115200 ? (int)heard.size() : 0; }
int SerialPort::read()
{
    if (heard.empty()) return -1;
    int c = (unsigned char)heard[0];
    heard.erase(0, 1);
    return c;
}

int main(int count, char **words)
{
    uint32_t total = (uint32_t)strtoul(words[1], 0, 10);
    first = (uint32_t)strtoul(words[2], 0, 10);
    uint32_t step = (uint32_t)strtoul(words[3], 0, 10);
    for (int i = 4; i + 1 < count; i += 2) script[(uint32_t)strtoul(words[i], 0, 10)] = words[i + 1];
    setup();
    for (; since < total; since += step) {
        if (script.count(since)) heard += script[since];
        loop();
    }
    return 0;
}
