out vec4 colour;
void main() {
    colour = vec4(PAPER, 1.0);
}
