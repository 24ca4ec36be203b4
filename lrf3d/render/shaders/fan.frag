in float range;
in float share;         // what is left towards the ends of the fan
uniform float reach;    // distance [m] at which nothing of the fan is left
uniform float strength;
out vec4 colour;
void main() {
    float left = clamp(1.0 - range / reach, 0.0, 1.0);
    // The power FAN_CURVE of the look, which is 1.5, at a fifth of the cost of pow.
    colour = vec4(FAN_COLOUR, strength * share * left * sqrt(left));
}
