in float range;
uniform float reach;    // distance [m] at which nothing of the fan is left
uniform float strength;
out vec4 colour;
void main() {
    float left = clamp(1.0 - range / reach, 0.0, 1.0);
    colour = vec4(0.98, 0.25, 0.18, strength * left * sqrt(left));
}
