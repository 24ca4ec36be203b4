in vec2 uv;
in vec3 way;
uniform sampler2D picture;
uniform vec4 area;
uniform vec4 beyond;    // colour of the ground past the picture, and width of the change [m]
out vec4 colour;
void main() {
    vec2 past = max(abs(uv - 0.5) - 0.5, 0.0) / area.zw;
    vec3 ground = mix(texture(picture, uv).rgb, beyond.rgb, min((past.x + past.y) / beyond.a, 1.0));
    float far = dot(way, way);
    colour = vec4(mix(ground, haze.rgb, far / (1.0 + far)), 1.0);
}
