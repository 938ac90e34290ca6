// Packets: WIDTH lanes side by side, which kernels work on whatever WIDTH is. F, I, U and M are floats, integers, unsigned
// integers and truths, F2, F3 and F4 two, three and four floats a lane. A device that runs scalar work-items side by side has
// WIDTH 1, where they are the language's own; one that has vector registers has as many lanes as they. `m ? a : b`, `&`, `|` and
// `!` of truths and arithmetic are written alike for all.

#define PASTE(a, b) a##b
#define OF_WIDTH(name, width) PASTE(name, width)

// Vector registers of a processor's core, as far as its compiler tells.
#ifdef __AVX512F__
#define REGISTERS 32
#else
#define REGISTERS 16
#endif

// Of what loops of packets call at each turn: a call would carry packets through memory, and leave none in a register.
#define INLINE __attribute__((always_inline))

#if WIDTH == 1

typedef float F;
typedef int I;
typedef uint U;
typedef int M;
typedef float2 F2;
typedef float3 F3;
typedef float4 F4;

// Numbers of the lanes.
#define LANE 0u
#define to_float(v) convert_float(v)
#define to_int(v) convert_int(v)
#define to_uint(v) convert_uint(v)
#define any_lane(m) (m)
#define first_lane(v) (v)
#define total(v) (v)
#define largest_lane(v) (v)
#define smallest_lane(v) (v)
#define largest_index(v) (v)
// What memory holds at each lane's index; of `fetch_four` vectors of four.
#define fetch(from, i) ((from)[i])
#define fetch_uint(from, i) ((from)[i])
#define fetch_four(from, i) ((from)[i])
#define as_index(v) ((uint)(v))
#define as_signed(v) ((int)(v))
#define as_float_lanes(v) as_float(v)
#define as_int_lanes(v) as_int(v)
// The lanes side by side in memory, and back.
#define unpack(v, to) ((to)[0] = (v))
#define pack(from) ((from)[0])
// Four floats of each lane side by side in memory.
#define together(v, to) ((to)[0] = (v))
#define floored(v) floor(v)
// e^x for x <= 0.
#define exp_negative(x) exp(x)
// A work-item's number among those of its workgroup, how many they are, and where they wait for each other.
#define MEMBER ((uint)get_local_id(0))
#define MEMBERS ((uint)get_local_size(0))
#define TEAM_MEETS barrier(CLK_GLOBAL_MEM_FENCE)

F3 f3(F x, F y, F z) {
    return (float3)(x, y, z);
}

F4 f4(F3 v, F w) {
    return (float4)(v, w);
}

#else

typedef OF_WIDTH(float, WIDTH) F;
typedef OF_WIDTH(int, WIDTH) I;
typedef OF_WIDTH(uint, WIDTH) U;
typedef OF_WIDTH(int, WIDTH) M;
typedef struct {
    F x;
    F y;
} F2;
typedef struct {
    F x;
    F y;
    F z;
} F3;
typedef struct {
    F x;
    F y;
    F z;
    F w;
} F4;

#define to_float(v) OF_WIDTH(convert_float, WIDTH)(v)
#define to_int(v) OF_WIDTH(convert_int, WIDTH)(v)
#define to_uint(v) OF_WIDTH(convert_uint, WIDTH)(v)
#define as_index(v) OF_WIDTH(as_uint, WIDTH)(v)
#define as_signed(v) OF_WIDTH(as_int, WIDTH)(v)
#define as_float_lanes(v) OF_WIDTH(as_float, WIDTH)(v)
#define as_int_lanes(v) OF_WIDTH(as_int, WIDTH)(v)
#define fetch(from, i) LANES_OF(F, __global const float *, from, i)
#define fetch_uint(from, i) LANES_OF(U, __global const uint *, from, i)
#define fetch_ushort(from, i) LANES_OF(U, __global const ushort *, (__global const ushort *)(from), i)
#define first_lane(v) ((v).s0)
#define MEMBER 0u
#define MEMBERS 1u
#define TEAM_MEETS
#define unpack(v, to) OF_WIDTH(vstore, WIDTH)(v, 0, to)
#define pack(from) OF_WIDTH(vload, WIDTH)(0, from)

// Two numbers that lie side by side, which need not lie as a number of their size must. With 32 registers LLVM may gather them. With
// sixteen it loads lane by lane, for which indices without a sign, which none has, are offsets as they are; and of doubles, with which
// nobody calculates, the second of a register needs no operation beside its load.
#if REGISTERS == 16 && defined(cl_khr_fp64)
typedef double Floats __attribute__((aligned(4)));
typedef double8 Floats8;
#else
typedef ulong Floats __attribute__((aligned(4)));
typedef ulong8 Floats8;
#endif
#if REGISTERS == 16
#define OFFSETS(i) as_index(i)
#else
#define OFFSETS(i) (i)
#endif
typedef uint Halves __attribute__((aligned(2)));
#define AT(pointer, from, i, lane) (*(pointer)((from) + OFFSETS(i).s##lane))
// The halves at each lane's index and behind it, as bits.
#define fetch_halves(from, i) LANES_OF(U, __global const Halves *, (__global const ushort *)(from), i)

F3 f3(F x, F y, F z) {
    F3 v = {x, y, z};
    return v;
}

F4 f4(F3 v, F w) {
    F4 four = {v.x, v.y, v.z, w};
    return four;
}

// Four floats of each of eight lanes, as they lie in memory: of the first four lanes, and of the last.
typedef struct {
    float16 first;
    float16 last;
} Eight;

// Of the first, second, third and fourth floats.
INLINE Eight beside(float8 x, float8 y, float8 z, float8 w) {
    float16 xy;
    float16 zw;
    xy.even = x;
    xy.odd = y;
    zw.even = z;
    zw.odd = w;
    ulong8 first;
    ulong8 last;
    first.even = as_ulong8(xy).lo;
    first.odd = as_ulong8(zw).lo;
    last.even = as_ulong8(xy).hi;
    last.odd = as_ulong8(zw).hi;
    Eight v = {as_float16(first), as_float16(last)};
    return v;
}

// The first and the second two of the four floats of each of eight lanes.
INLINE Eight apart(Eight v) {
    ulong8 first = as_ulong8(v.first);
    ulong8 last = as_ulong8(v.last);
    Eight pairs = {as_float16((ulong8)(first.even, last.even)), as_float16((ulong8)(first.odd, last.odd))};
    return pairs;
}

#define FOURS(from, i, a, b, c, d)                                                                                    \
    ((float16)((from)[(i).s##a], (from)[(i).s##b], (from)[(i).s##c], (from)[(i).s##d]))

#if WIDTH == 8

#define LANE ((U)(0, 1, 2, 3, 4, 5, 6, 7))
#define LANES_OF(kind, pointer, from, i)                                                                              \
    ((kind)(AT(pointer, from, i, 0), AT(pointer, from, i, 1), AT(pointer, from, i, 2), AT(pointer, from, i, 3),       \
            AT(pointer, from, i, 4), AT(pointer, from, i, 5), AT(pointer, from, i, 6), AT(pointer, from, i, 7)))
#define fetch_four(from, i) of_lanes(FOURS(from, i, 0, 1, 2, 3), FOURS(from, i, 4, 5, 6, 7))

INLINE F4 of_lanes(float16 a, float16 b) {
    Eight v = {a, b};
    v = apart(v);
    F4 four = {v.first.even, v.first.odd, v.last.even, v.last.odd};
    return four;
}

INLINE void together(F4 v, float4 *to) {
    Eight lanes = beside(v.x, v.y, v.z, v.w);
    vstore16(lanes.first, 0, (float *)to);
    vstore16(lanes.last, 1, (float *)to);
}

int or_of_lanes(M m) {
    int4 four = m.lo | m.hi;
    int2 two = four.lo | four.hi;
    return two.x | two.y;
}

float total(F v) {
    float4 four = v.lo + v.hi;
    float2 two = four.lo + four.hi;
    return two.x + two.y;
}

float largest_lane(F v) {
    float4 four = v.lo > v.hi ? v.lo : v.hi;
    float2 two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
}

int largest_index(I v) {
    int4 four = v.lo > v.hi ? v.lo : v.hi;
    int2 two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
}

#else

#define LANE ((U)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define LANES_OF(kind, pointer, from, i)                                                                              \
    ((kind)(AT(pointer, from, i, 0), AT(pointer, from, i, 1), AT(pointer, from, i, 2), AT(pointer, from, i, 3),       \
            AT(pointer, from, i, 4), AT(pointer, from, i, 5), AT(pointer, from, i, 6), AT(pointer, from, i, 7),       \
            AT(pointer, from, i, 8), AT(pointer, from, i, 9), AT(pointer, from, i, a), AT(pointer, from, i, b),       \
            AT(pointer, from, i, c), AT(pointer, from, i, d), AT(pointer, from, i, e), AT(pointer, from, i, f)))
#define fetch_four(from, i)                                                                                           \
    of_lanes(FOURS(from, i, 0, 1, 2, 3), FOURS(from, i, 4, 5, 6, 7), FOURS(from, i, 8, 9, a, b),                      \
             FOURS(from, i, c, d, e, f))

INLINE F4 of_lanes(float16 a, float16 b, float16 c, float16 d) {
    Eight low = {a, b};
    Eight high = {c, d};
    low = apart(low);
    high = apart(high);
    F4 four = {(F)(low.first.even, high.first.even), (F)(low.first.odd, high.first.odd),
               (F)(low.last.even, high.last.even), (F)(low.last.odd, high.last.odd)};
    return four;
}

INLINE void together(F4 v, float4 *to) {
    Eight low = beside(v.x.lo, v.y.lo, v.z.lo, v.w.lo);
    Eight high = beside(v.x.hi, v.y.hi, v.z.hi, v.w.hi);
    vstore16(low.first, 0, (float *)to);
    vstore16(low.last, 1, (float *)to);
    vstore16(high.first, 2, (float *)to);
    vstore16(high.last, 3, (float *)to);
}

int or_of_lanes(M m) {
    int8 eight = m.lo | m.hi;
    int4 four = eight.lo | eight.hi;
    int2 two = four.lo | four.hi;
    return two.x | two.y;
}

float total(F v) {
    float8 eight = v.lo + v.hi;
    float4 four = eight.lo + eight.hi;
    float2 two = four.lo + four.hi;
    return two.x + two.y;
}

float largest_lane(F v) {
    float8 eight = v.lo > v.hi ? v.lo : v.hi;
    float4 four = eight.lo > eight.hi ? eight.lo : eight.hi;
    float2 two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
}

int largest_index(I v) {
    int8 eight = v.lo > v.hi ? v.lo : v.hi;
    int4 four = eight.lo > eight.hi ? eight.lo : eight.hi;
    int2 two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
}

#endif

// LLVM asks a register of masks, where it is told what is asked.
#ifdef __has_builtin
#if __has_builtin(__builtin_reduce_or)
#define or_of_lanes(m) __builtin_reduce_or(m)
#endif
#endif

INLINE int any_lane(M m) {
    return or_of_lanes(m) != 0;
}

#define smallest_lane(v) (-largest_lane(-(v)))

// Rounded down, of what an integer holds. The language's own takes a dozen operations for what one does not.
INLINE F floored(F v) {
    F n = to_float(to_int(v));
    return n > v ? n - 1.0f : n;
}

#endif

// What lookups of a field take and give: of floats those of all lanes, of colours those of one.
#define POINT_float F3
#define POINT_float4 float3
#define PLACE_float F
#define PLACE_float4 float
#define INDEX_float I
#define INDEX_float4 int
#define FOUND_float F
#define FOUND_float4 float4
#define INT_float to_int
#define INT_float4 convert_int
#define FLOAT_float to_float
#define FLOAT_float4 convert_float
#define FIRST_float(v) first_lane(v)
#define FIRST_float4(v) (v)
#define COLORED_float 0
#define COLORED_float4 1

// Where texels lie: in which of a field's slabs, and at which place in it.
typedef struct {
    I slab;
    I place;
} TEXEL_float;
typedef struct {
    int slab;
    int place;
} TEXEL_float4;

// A texel and the next along x.
typedef struct {
    F near;
    F far;
} PAIR_float;
typedef struct {
    float4 near;
    float4 far;
} PAIR_float4;

// b of 1 - e^-x = x - x^2 b for |x| <= ln 2 / 2.
INLINE F curvature(F x) {
    // x - x^2/2 + ... - c x^6 whose largest error relative to e^-x is the least, 4e-9. In pairs, which wait less for each other.
    F square = x * x;
    F first = 0.5f - x * 0.16666535f;
    F second = 0.041667238f - x * 0.008367497f;
    return first + square * (second + square * 0.0013863771f);
}

// 1 - e^-x for |x| <= ln 2 / 2.
INLINE F lost(F x) {
    return x - x * x * curvature(x);
}

// 2^n and the rest r of e^-x = 2^n e^-r, for x from 0 to 87.
INLINE F2 decay_parts(F x) {
    // 1.5 times 2^23: a sum with it is rounded to an integer, which is its last bits.
    F shifted = x * -1.44269504f + 12582912.0f;
    F n = shifted - 12582912.0f;
    // ln 2 in two parts, the first exact in few bits so that n times it is exact.
    F2 parts;
    parts.x = as_float_lanes((as_int_lanes(shifted) + 127) << 23);
    parts.y = n * 0.693359375f + x + n * -2.12194440e-4f;
    return parts;
}

#if WIDTH > 1

// e^x for x <= 0, to two units in the last place; e^-87 and below is about 1e-38. The language's own is a call a lane.
INLINE F exp_negative(F x) {
    F2 parts = decay_parts(-(x > (F)(-87.0f) ? x : (F)(-87.0f)));
    return parts.x - parts.x * lost(parts.y);
}

// What the upper halves of words are. A half's bits in the places of a float's are 2^112 times smaller; the language's own may be a
// call a lane.
INLINE F from_half(U words) {
    return as_float_lanes(as_signed(words) >> 3 & (int)0x8fffe000u) * 0x1p112f;
}

#endif

// The floats at each lane's index and behind it, by one load a lane of a packet.
#define FLOATS_AT(lane) AT(__global const Floats *, from, i, lane)
INLINE PAIR_float fetch_pair(__global const float *from, I i) {
    PAIR_float pair;
#if WIDTH == 1
    pair.near = from[i];
    pair.far = from[i + 1];
#else
    float16 first = as_float16((Floats8)(FLOATS_AT(0), FLOATS_AT(1), FLOATS_AT(2), FLOATS_AT(3), FLOATS_AT(4),
                                         FLOATS_AT(5), FLOATS_AT(6), FLOATS_AT(7)));
#if WIDTH == 8
    pair.near = first.even;
    pair.far = first.odd;
#else
    float16 second = as_float16((Floats8)(FLOATS_AT(8), FLOATS_AT(9), FLOATS_AT(a), FLOATS_AT(b), FLOATS_AT(c),
                                          FLOATS_AT(d), FLOATS_AT(e), FLOATS_AT(f)));
    pair.near = (F)(first.even, second.even);
    pair.far = (F)(first.odd, second.odd);
#endif
#endif
    return pair;
}

// Number of a packet's first element within its dispatch.
size_t number(void) {
    return get_global_id(0) * WIDTH;
}

// Numbers of the elements of the packet that begins with `first`, of so many; lanes past the last repeat it.
U elements(size_t first, uint count) {
    U n = (uint)first + LANE;
    return n < count ? n : (U)(count - 1u);
}

// Its lanes that are not past the last.
M filled(size_t first, uint count) {
    return (uint)first + LANE < count;
}

// Stores the lanes that are marked, each at its index.
void put(F v, __global float *to, U index, const int *marked) {
    float values[WIDTH];
    uint at[WIDTH];
    unpack(v, values);
    unpack(index, at);
    for (uint i = 0u; i < WIDTH; i++) {
        if (marked[i]) {
            to[at[i]] = values[i];
        }
    }
}

// Stores four floats a lane that is marked.
INLINE void put_four(__global float4 *to, U index, M kept, F4 v) {
    float4 values[WIDTH];
    uint at[WIDTH];
    int marked[WIDTH];
    together(v, values);
    unpack(index, at);
    unpack(kept, marked);
    for (uint i = 0u; i < WIDTH; i++) {
        if (marked[i]) {
            to[at[i]] = values[i];
        }
    }
}

// Stores eight floats a lane that is marked, as two vectors behind each other.
void put_eight(__global float4 *to, U index, M kept, F3 first, F fourth, F3 second, F eighth) {
    put_four(to, 2u * index, kept, f4(first, fourth));
    put_four(to, 2u * index + 1u, kept, f4(second, eighth));
}

// Stores the first `count` lanes, one behind the other.
void put_row(F v, __global float *to, uint count) {
    if (count == WIDTH) {
        unpack(v, to);
        return;
    }
    float values[WIDTH];
    unpack(v, values);
    for (uint i = 0u; i < count; i++) {
        to[i] = values[i];
    }
}

// Adds the first `count` lanes to what is there, one behind the other.
void add_row(F v, __global float *to, uint count) {
    if (count == WIDTH) {
        unpack(pack(to) + v, to);
        return;
    }
    float values[WIDTH];
    unpack(v, values);
    for (uint i = 0u; i < count; i++) {
        to[i] += values[i];
    }
}

// Stores the first `count` lanes, `hop` floats apart.
INLINE void put_apart(F v, __global float *to, uint hop, uint count) {
    float values[WIDTH];
    unpack(v, values);
    // Else LLVM makes scatters of the loop, which are slower than stores one by one on some processors.
#pragma clang loop vectorize(disable)
    for (uint i = 0u; i < count; i++) {
        to[i * hop] = values[i];
    }
}

// Stores the first `count` lanes as four floats each, the last of them zero.
INLINE void put_colors(F3 v, __global float *to, uint count) {
    float4 values[WIDTH];
    together(f4(v, (F)(0.0f)), values);
    if (count == WIDTH) {
#if WIDTH == 1
        vstore4(values[0], 0, to);
#else
#pragma unroll
        for (uint i = 0u; i < WIDTH / 4u; i++) {
            vstore16(vload16(i, (const float *)values), i, to);
        }
#endif
        return;
    }
    for (uint i = 0u; i < count; i++) {
        vstore4(values[i], i, to);
    }
}

// Adds them to what is there.
void add_to(F v, __global float *to, U index, const int *marked) {
    float values[WIDTH];
    uint at[WIDTH];
    unpack(v, values);
    unpack(index, at);
    for (uint i = 0u; i < WIDTH; i++) {
        if (marked[i]) {
            to[at[i]] += values[i];
        }
    }
}

// The lesser, and `b` where `a` is not a number.
F lesser(F a, F b) {
    return a < b ? a : b;
}

// The greater, and `b` where `a` is not a number.
F greater(F a, F b) {
    return a > b ? a : b;
}

// The same value in all lanes.
F3 all3(float3 v) {
    return f3((F)(v.x), (F)(v.y), (F)(v.z));
}

F3 add3(F3 a, F3 b) {
    return f3(a.x + b.x, a.y + b.y, a.z + b.z);
}

F3 sub3(F3 a, F3 b) {
    return f3(a.x - b.x, a.y - b.y, a.z - b.z);
}

F3 mul3(F3 a, F3 b) {
    return f3(a.x * b.x, a.y * b.y, a.z * b.z);
}

F3 scale3(F3 a, F b) {
    return f3(a.x * b, a.y * b, a.z * b);
}

F dot3(F3 a, F3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

F3 pick3(M m, F3 yes, F3 no) {
    return f3(m ? yes.x : no.x, m ? yes.y : no.y, m ? yes.z : no.z);
}
