in vec4 paint;
noperspective in float off;
uniform float width;
out vec4 colour;
void main() {
    float cover = clamp(0.5 * width + 0.5 - abs(off), 0.0, 1.0);
    colour = vec4(paint.rgb, paint.a * cover);
}
