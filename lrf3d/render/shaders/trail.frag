in float time;
in vec3 world;
uniform float now;
out vec4 colour;
void main() {
    if (time > now) discard;
    colour = vec4(hazed(vec3(0.14, 0.48, 0.90), world), 0.95);
}
