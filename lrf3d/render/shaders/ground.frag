in vec2 uv;
in vec3 way;
uniform sampler2D picture;
out vec4 colour;
// The smaller copies of the picture are for pixels as wide as long; streets are seen at a slant.
const float SHARPER = -0.6;
void main() {
    vec3 ground = texture(picture, uv, SHARPER).rgb;
    float far = dot(way, way);
    colour = vec4(mix(ground, haze.rgb, far / (1.0 + far)), 1.0);
}
