// The .vdb files that OpenVDB's Python module cannot make; make.py compiles and runs this.
#include <openvdb/openvdb.h>
#include <openvdb/io/Stream.h>
#include <fstream>

using namespace openvdb;

// Ways to pack values. Without any (and no mask) a node alone takes 147 kB: the reference files have that case.
const uint32_t kinds[] = {io::COMPRESS_ZIP, io::COMPRESS_BLOSC, io::COMPRESS_ACTIVE_MASK,
    io::COMPRESS_ZIP | io::COMPRESS_ACTIVE_MASK, io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK};
const char* names[] = {"zip", "blosc", "mask", "zip-mask", "blosc-mask"};

void write(const std::string& path, const GridPtrVec& grids, uint32_t compression)
{
    io::File file(path);
    file.setCompression(compression);
    file.write(grids);
    file.close();
}

// Seven leaves with the first voxels (8 c, -16, 0) and a background of 2. Voxel n (x fastest) of each is active with
// value n / 4 where n % 3 == 0, else inactive with a value that depends on c, so that all seven ways to store
// inactive values occur.
FloatGrid::Ptr inactive()
{
    const float values[7][3] = {{2, 2, 2}, {-2, -2, -2}, {5, 5, 5}, {2, -2, 2}, {2, 5, 2}, {5, 7, 5}, {5, 7, 9}};
    FloatGrid::Ptr grid = FloatGrid::create(2);
    for (int c = 0; c < 7; ++c) {
        for (int n = 0; n < 512; ++n) {
            const Coord at(8 * c + n % 8, -16 + n / 8 % 8, n / 64);
            if (n % 3 == 0) grid->tree().setValueOn(at, n / 4.0f);
            else grid->tree().setValueOff(at, values[c][n / 5 % 3]);
        }
    }
    grid->setName("density");
    return grid;
}

FloatGrid::Ptr small(const std::string& name)
{
    FloatGrid::Ptr grid = FloatGrid::create(0);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 2; ++j) grid->tree().setValueOn(Coord(i, j, -1), float(1 + i + 10 * j));
    grid->setName(name);
    grid->setGridClass(GRID_FOG_VOLUME);
    return grid;
}

int main()
{
    initialize();
    for (int k = 0; k < 5; ++k) {
        for (bool half : {false, true}) {
            FloatGrid::Ptr grid = inactive();
            grid->setSaveFloatAsHalf(half);
            write(std::string("inactive-") + names[k] + (half ? "-half" : "") + ".vdb", {grid}, kinds[k]);
        }
    }

    // Every linear map.
    GridPtrVec maps;
    const auto add = [&](const char* name, math::MapBase::Ptr map) {
        maps.push_back(small(name));
        maps.back()->setTransform(math::Transform::Ptr(new math::Transform(map)));
    };
    add("uniform-scale", math::MapBase::Ptr(new math::UniformScaleMap(0.5)));
    add("scale", math::MapBase::Ptr(new math::ScaleMap(Vec3d(0.5, 0.25, 2))));
    add("uniform-scale-translate", math::MapBase::Ptr(new math::UniformScaleTranslateMap(0.5, Vec3d(1, 2, 3))));
    add("scale-translate", math::MapBase::Ptr(new math::ScaleTranslateMap(Vec3d(0.5, -0.25, 2), Vec3d(1, 2, 3))));
    add("translation", math::MapBase::Ptr(new math::TranslationMap(Vec3d(1, 2, 3))));
    add("unitary", math::MapBase::Ptr(new math::UnitaryMap(Vec3d(0, 0, 1), M_PI / 2)));
    add("affine", math::MapBase::Ptr(new math::AffineMap(Mat4d(0., 2., 0., 0., -1., 0., 0., 0., 0., 0.5, 3., 0., 7., 8., 9., 1.))));
    write("maps.vdb", maps, io::COMPRESS_ACTIVE_MASK);

    // Two grids that share a tree, with maps of their own.
    FloatGrid::Ptr first = small("density"), second = first->copy();
    second->setName("shifted");
    second->setTransform(math::Transform::Ptr(
        new math::Transform(math::MapBase::Ptr(new math::TranslationMap(Vec3d(1, 2, 3))))));
    write("instance.vdb", {first, second}, io::COMPRESS_ACTIVE_MASK);

    // A stream: without the grids' offsets. Past the vectors nothing can be found.
    Vec3SGrid::Ptr vectors = Vec3SGrid::create();
    vectors->setName("velocity");
    vectors->tree().setValueOn(Coord(1, 2, 3), Vec3f(1, 2, 3));
    std::ofstream out("stream.vdb", std::ios::binary);
    io::Stream(out).write(GridPtrVec{small("first"), small("second"), vectors, small("third")});
}
