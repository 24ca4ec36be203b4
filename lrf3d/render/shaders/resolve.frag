uniform sampler2DMS colours;
uniform sampler2DMS depths;
out vec4 colour;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    colour = 0.25 * (texelFetch(colours, at, 0) + texelFetch(colours, at, 1)
        + texelFetch(colours, at, 2) + texelFetch(colours, at, 3));
    gl_FragDepth = texelFetch(depths, at, 0).r;
}
