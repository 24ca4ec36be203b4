in float left;          // what the way from the robot leaves
in float share;         // what is left towards the ends of the fan
out vec4 colour;
void main() {
    float near = clamp(left, 0.0, 1.0);
    // The power FAN_CURVE of the look, which is 1.5, at a fifth of the cost of pow.
    colour = vec4(FAN_COLOUR, share * near * sqrt(near));
}
