/* Swims the plan open loop. The light is on until the motor starts: put the head's centre at the start of schedule.h. */
#include <softflagella.h>

const uint8_t PLUS_PIN = 9;   /* H-bridge's input for direction +1; a pin with PWM */
const uint8_t MINUS_PIN = 10; /* for direction -1 */
const uint8_t DUTY = 255;     /* of the PWM, 0 to 255: set it so that the motor has the speed of the plan */
const uint16_t WAIT_S = 20;   /* until the motor starts */

Motor motor(PLUS_PIN, MINUS_PIN, DUTY);
Schedule schedule;

void setup()
{
    motor.begin();
    pinMode(LED_BUILTIN, OUTPUT);
    digitalWrite(LED_BUILTIN, HIGH);
    delay(1000UL * WAIT_S);
    digitalWrite(LED_BUILTIN, LOW);
    schedule.begin(millis());
}

void loop() { motor.turn(schedule.at(millis())); }
