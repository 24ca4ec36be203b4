// What all shaders know: the camera of the picture, its air, and what the laser has lit. In fragment
// shaders each uniform takes time for each block of pixels; what is the same in all pictures of a
// film is a constant.
layout(std140) uniform Camera {
    mat4 view_projection;
    vec3 eye;
    float thick;        // one over the distance [m] at which half is haze
    vec2 viewport;      // [pixels]
    float slack;        // how much the depth of marks gains with their distance
    float nearer;       // how much nearer to the eye the depth of marks is [m]
};

#ifndef VERTEX
// A colour seen through the air, by its depth in the picture.
vec3 hazed(vec3 colour) {
    // Grows with the square of the distance and needs neither a root nor an exponential.
    float far = thick / gl_FragCoord.w;
    far *= far;
    return mix(colour, HAZE, far / (1.0 + far));
}
#endif

// Where a point is drawn whose depth is that of a point nearer to the eye by so many metres: what
// lies on a surface then shows, and what lies behind one does not.
vec4 raised(vec3 place, float metres) {
    vec3 ray = eye - place;
    float away = length(ray);
    vec4 drawn = view_projection * vec4(place, 1.0);
    vec4 near = view_projection * vec4(place + ray / away * min(metres + slack * away, 0.5 * away), 1.0);
    drawn.z = near.z / near.w * drawn.w;
    return drawn;
}

// Whether what lies on a thin wall is seen: from the side that it faces, or from far above.
bool shown(vec3 place, vec2 side) {
    return nearer > 1e3 || dot(eye.xy - place.xy, side) >= 0.0;
}

float grey(vec3 colour) {
    return dot(colour, vec3(0.3, 0.55, 0.15));
}

// Time since a place was first seen [s of the film], from the picture of times.
float age(vec4 when, vec2 clock) {
    return (clock.x - when.r) * clock.y - when.a;
}

// How much of the light a place has got by an age.
float lit(vec4 when, float age) {
    float share = clamp(age / DAWN, 0.0, 1.0);
    // The picture of times is smooth, so that where it is half is an edge finer than its cells.
    float sure = clamp(0.5 + (when.g - 0.5) / RIM, 0.0, 1.0);
    return sure * share * share * (3.0 - 2.0 * share);
}

uniform float dusk;     // how far the dark has become dusk: at the end, the model stands in it

// A colour in the light of the laser: dark before it came, aglow with it, cool and bright after. In
// the dark the bare colour is seen, without what is on it.
vec3 exposed(vec3 day, vec3 bare, float on, float age, float height) {
    float bright = grey(day);
    // Light of a lamp so low fades up high walls.
    float share = on * max(1.0 - FALL * height, LEAST_FALL);
    float hot = on / (1.0 + 2.0 * age * age);
    vec3 cool = day * COOL * (1.0 - EMBER_SHARE.x * hot);
    vec3 seen = cool + EMBER * (hot * (EMBER_SHARE.y + EMBER_SHARE.z * bright));
    return mix(mix(NIGHT_LOW, mix(NIGHT_HIGH, DUSK, dusk), grey(bare)), seen, share);
}

#if defined(MIRRORED) && !defined(VERTEX)
// Drawn from the mirrored eye: only what rays meet past the mirror, through its rectangle.
uniform vec4 mirror;        // one end of it, and the direction to the other
uniform vec3 mirror_size;   // length, height, and the distance of the mirrored eye behind it [m]
// The way is that from the eye.
void through_mirror(vec3 way) {
    vec2 normal = vec2(-mirror.w, mirror.z) * sign(mirror_size.z);
    float rise = dot(normal, way.xy), behind = abs(mirror_size.z);
    vec3 met = eye + way * (behind / rise);
    float along = dot(met.xy - mirror.xy, mirror.zw);
    bool past = rise > behind;
    if (!past || along < 0.0 || along > mirror_size.x || met.z < 0.0 || met.z > mirror_size.y) discard;
}
#endif
