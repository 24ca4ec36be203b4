// The mean of the samples of each pixel, and the depth of one.
#ifdef VERTEX
layout(location = 0) in vec2 corner;
void main() {
    gl_Position = vec4(corner, 0.0, 1.0);
}
#else
uniform sampler2DMS colours;
uniform sampler2DMS depths;
out vec4 colour;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    colour = 0.25 * (texelFetch(colours, at, 0) + texelFetch(colours, at, 1)
        + texelFetch(colours, at, 2) + texelFetch(colours, at, 3));
    gl_FragDepth = texelFetch(depths, at, 0).r;
}
#endif
