in vec4 paint;
in vec3 world;
out vec4 colour;
void main() {
    colour = vec4(hazed(paint.rgb, world), paint.a);
}
