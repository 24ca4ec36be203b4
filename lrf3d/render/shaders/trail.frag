in float time;
in vec3 world;
uniform float now;
out vec4 colour;
void main() {
    if (time > now) discard;
    colour = vec4(hazed(TRAIL_COLOUR, world), 0.95);
}
