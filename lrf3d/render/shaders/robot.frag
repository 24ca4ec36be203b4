in vec3 world;
in vec3 facing;
in vec3 paint;
out vec4 colour;
void main() {
    vec3 up = normalize(facing);
    vec3 to_eye = normalize(eye - world);
    float light = 0.56 + 0.36 * max(dot(up, sun), 0.0) + 0.06 * up.z;
    float shine = pow(max(dot(up, normalize(sun + to_eye)), 0.0), 40.0);
    float rim = pow(1.0 - max(dot(up, to_eye), 0.0), 3.0);
    vec3 shaded = paint * light + 0.22 * shine + 0.07 * rim;
    colour = vec4(hazed(shaded, world), 1.0);
}
