// Prints a row of a glove 50 times a second: a clock, two switches, a flex sensor and a pad.
// Upload it, close the serial monitor, then: thenar doctor --line /dev/ttyUSB0 --propose glove.toml
const byte SWITCHES[] = {2, 3};  // each connects its pin to ground
const byte ANALOG[] = {A0, A1};  // each between its pin's divider and the supply
unsigned long due = 0;

void setup() {
  Serial.begin(115200);
  for (byte pin : SWITCHES) pinMode(pin, INPUT_PULLUP);
  Serial.println(F("ms,thumb,index,flex_index,pad_palm"));
}

void loop() {
  if (millis() - due < 20) return;
  due += 20;
  Serial.print(millis());
  for (byte pin : SWITCHES) Serial.print(digitalRead(pin) == LOW ? F(",1") : F(",0"));
  for (byte pin : ANALOG) { Serial.print(','); Serial.print(analogRead(pin)); }
  Serial.println();
}
