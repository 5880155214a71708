/* Obeys a computer that tracks the robot: F forward (+1), B reverse (-1), S stop, each in a line of its own. The
 * computer repeats the order several times a second; after a second of silence the motor stops. */
#include <softflagella.h>

const uint8_t PLUS_PIN = 9;   /* H-bridge's input for direction +1; a pin with PWM */
const uint8_t MINUS_PIN = 10; /* for direction -1 */
const uint8_t DUTY = 255;     /* of the PWM, 0 to 255: set it so that the motor has the speed of the plan */
const uint32_t BAUD = 115200;
const uint32_t SILENCE_MS = 1000;

Motor motor(PLUS_PIN, MINUS_PIN, DUTY);
uint32_t heard = 0;

void order(int8_t direction)
{
    motor.turn(direction);
    heard = millis();
}

void setup()
{
    motor.begin();
    Serial.begin(BAUD);
}

void loop()
{
    while (Serial.available() > 0) {
        switch (Serial.read()) {
        case 'F': order(1); break;
        case 'B': order(-1); break;
        case 'S': order(0); break;
        }
    }
    if ((uint32_t)millis() - heard >= SILENCE_MS) motor.turn(0);
}
