in vec2 uv;
in vec3 way;
uniform sampler2D picture;
out vec4 colour;
void main() {
    vec3 ground = texture(picture, uv, -SHARPNESS).rgb;
    float far = dot(way, way);
    colour = vec4(mix(ground, haze.rgb, far / (1.0 + far)), 1.0);
}
