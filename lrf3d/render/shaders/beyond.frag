in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform vec4 area;
uniform vec4 beyond;    // colour of the ground past the picture, and width of the change [m]
out vec4 colour;
void main() {
    vec2 past = max(abs(uv - 0.5) - 0.5, 0.0) / area.zw;
    float share = min((past.x + past.y) / beyond.a, 1.0);
    // What is painted at the rim, such as a line, fades into the mean of what is around it.
    vec3 rim = texture(picture, uv, 4.0 * min(16.0 * share, 1.0)).rgb;
    vec3 ground = mix(rim, beyond.rgb, share);
    float far = dot(way, way);
    colour = vec4(mix(ground, haze.rgb, far / (1.0 + far)), 1.0);
}
