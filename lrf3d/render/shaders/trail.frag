in float time;
in vec3 way;
uniform float now;
uniform float fade;     // one over the time [s] in which it fades
out vec4 colour;
void main() {
    if (time > now) discard;
    float old = min((now - time) * fade, 1.0);
    colour = vec4(hazed(TRAIL_COLOUR, way), mix(0.95, TRAIL_OLD, old * (2.0 - old)));
}
