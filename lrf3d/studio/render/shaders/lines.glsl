// Lines of even width with soft edges, of two triangles each.
#ifdef VERTEX
uniform vec2 width;     // [pixels], and at least [pixels at 1 m]
layout(location = 0) in vec3 start;
layout(location = 1) in vec3 end;
layout(location = 2) in vec3 tint;
layout(location = 3) in vec2 opacities; // at both ends
out vec4 paint;
out vec3 off;                   // from the middle of the line, and half its width [pixels], times the depth; that
const float NEAR = 0.25;        // no less than that of the camera [m]
void main() {
    // The corners of a line: two at its start and two at its end, to the left and right.
    bool ends = (gl_VertexID & 2) != 0;
    float turn = (gl_VertexID & 1) == 0 ? 1.0 : -1.0;
    vec3 here = ends ? end : start;
    vec3 there = ends ? start : end;
    // What lies behind the eye is cut off before the division turns it round.
    float w = (view_projection * vec4(here, 1.0)).w;
    vec4 b = view_projection * vec4(there, 1.0);
    bool crosses = w < NEAR && b.w > NEAR;
    vec4 a = raised(crosses ? mix(here, there, (NEAR - w) / (b.w - w)) : here, nearer);
    if (b.w < NEAR && a.w > NEAR) b = mix(b, a, (NEAR - b.w) / (a.w - b.w));
    vec2 way = (b.xy / b.w - a.xy / a.w) * viewport;
    vec2 across = normalize(vec2(-way.y, way.x) + vec2(1e-9, 0.0)) * turn;
    float half_width = 0.5 * max(width.x, width.y / a.w) + 0.75;
    a.xy += across * half_width * 2.0 / viewport * a.w;
    // Seen from the end, left and right have changed places.
    // Divided by the depth it is straight in the picture, and not in space.
    off = vec3(turn * half_width * (ends ? -1.0 : 1.0), half_width, 1.0) * a.w;
    paint = vec4(tint, ends ? opacities.y : opacities.x);
    gl_Position = a;
}
#else
in vec4 paint;
in vec3 off;
out vec4 colour;
void main() {
    float cover = clamp((off.y - abs(off.x)) / off.z - 0.25, 0.0, 1.0);
    colour = vec4(paint.rgb, paint.a * cover);
}
#endif
