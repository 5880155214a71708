/* First test: the motor turns at +1 for five seconds. Seen from above, the robot must turn left. If it turns right,
 * exchange the two wires of the motor. */
#include <softflagella.h>

const uint8_t PLUS_PIN = 9;   /* H-bridge's input for direction +1; a pin with PWM */
const uint8_t MINUS_PIN = 10; /* for direction -1 */
const uint8_t DUTY = 255;     /* of the PWM, 0 to 255: set it so that the motor has the speed of the plan */

Motor motor(PLUS_PIN, MINUS_PIN, DUTY);

void setup()
{
    motor.begin();
    delay(5000); /* time to let go */
    motor.turn(1);
    delay(5000);
    motor.turn(0);
}

void loop() {}
