in vec2 place;
uniform vec4 blob;
out vec4 colour;
void main() {
    colour = vec4(SHADOW_COLOUR, blob.w * (1.0 - smoothstep(0.45, 1.0, length(place))));
}
