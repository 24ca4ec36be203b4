in vec3 to_eye;
in vec3 facing;
flat in vec3 paint;
out vec4 colour;
void main() {
    vec3 up = normalize(facing);
    vec3 back = normalize(to_eye);
    float light = 0.56 + 0.36 * max(dot(up, SUN), 0.0) + 0.06 * up.z;
    float shine = max(dot(up, normalize(SUN + back)), 0.0);
    // Powers by squaring: 32 and 3.
    shine *= shine; shine *= shine; shine *= shine; shine *= shine; shine *= shine;
    float rim = 1.0 - max(dot(up, back), 0.0);
    vec3 shaded = paint * light + 0.22 * shine + 0.07 * rim * rim * rim;
    colour = vec4(hazed(shaded, to_eye * thick), 1.0);
}
