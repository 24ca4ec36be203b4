in vec4 paint;
in vec3 way;
out vec4 colour;
void main() {
    colour = vec4(hazed(paint.rgb, way), paint.a);
}
