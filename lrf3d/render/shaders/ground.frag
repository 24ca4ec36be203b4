in vec2 place;
uniform sampler2D picture;
uniform vec4 area;      // lower left corner and size of the picture [m]
uniform vec4 beyond;    // colour of the ground past the picture, and width of the change [m]
out vec4 colour;
void main() {
    vec2 uv = (place - area.xy) / area.zw;
    vec3 ground = texture(picture, uv).rgb;
    vec2 past = max(abs(uv - 0.5) - 0.5, 0.0) * area.zw;
    ground = mix(ground, beyond.rgb, min((past.x + past.y) / beyond.a, 1.0));
    colour = vec4(hazed(ground, vec3(place, 0.0)), 1.0);
}
