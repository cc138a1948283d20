/* glTF 2.0 import: a file becomes a world.
 *
 * tinygltf turns the screened JSON text (gltf_json.c) into structures and decodes images; everything that sizes or addresses
 * memory is checked here before it is used, whether or not tinygltf looked at it. Errors inside of this file are thrown as
 * `refusal` after es_fail has said what is wrong; nothing is thrown across es_world_import_gltf.
 *
 * Section numbers are those of the glTF 2.0 specification. */
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <map>
#include <new>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <tiny_gltf.h>

/* these first: the headers below include them too, and they know nothing of C++ */
extern "C" {
#include "platform/context.h"
#include "platform/maths.h"
}
#include "sim/edits/edit_file.h"
#include "sim/gltf_environment.h"
#include "sim/gltf_file.h"
#include "sim/gltf_physics.h"
#include "sim/world.h"

namespace
{

/* Vertices that all meshes of a file may have together (8 GiB of streams), and elements of an accessor that has no data of
 * its own: both keep a file of a few kilobytes from asking for all memory where the context has no cap. */
constexpr uint64_t max_vertices = 1ull << 27;
constexpr uint64_t max_zero_elements = 1ull << 24;
/* Accessor elements that are read in all: a bound on time, since a few bytes can name the same accessor once more. The
 * vertices allowed above, with eight attributes each. */
constexpr uint64_t max_elements_read = 1ull << 30;
/* Shear below this (cosine between two axes) is what rounding leaves in a decomposed matrix. */
constexpr double shear_tolerance = 1e-3;

struct refusal { es_result result; };

/* Memory of the context for standard containers. */
template <class T> struct counted {
    using value_type = T;
    es_context* context;
    explicit counted(es_context* c) : context(c) {}
    template <class U> counted(const counted<U>& other) : context(other.context) {}
    T* allocate(size_t count)
    {
        void* memory = es_allocate_array(context, count, sizeof(T));
        if (!memory) { throw refusal{es_context_last_result(context)}; }
        return static_cast<T*>(memory);
    }
    void deallocate(T* memory, size_t count) { es_release(context, memory, count * sizeof(T)); }
    template <class U> bool operator==(const counted<U>& other) const { return context == other.context; }
    template <class U> bool operator!=(const counted<U>& other) const { return context != other.context; }
};
template <class T> using list = std::vector<T, counted<T>>;

/* ---- values of extensions and extras (sim/gltf_values.h) --------------------------------------------------------------- */

const tinygltf::Value* value_at(const void* value) { return static_cast<const tinygltf::Value*>(value); }

/* Not Value::Get(name): that one keeps a static object for what is absent. */
const void* value_member(const void* object, const char* name)
{
    if (!object || !value_at(object)->IsObject()) { return nullptr; }
    const tinygltf::Value::Object& members = value_at(object)->Get<tinygltf::Value::Object>();
    auto found = members.find(name);
    return found == members.end() ? nullptr : &found->second;
}

const void* value_element(const void* array, size_t i)
{
    const tinygltf::Value::Array& elements = value_at(array)->Get<tinygltf::Value::Array>();
    return i < elements.size() ? &elements[i] : nullptr;
}

bool value_is_object(const void* value) { return value && value_at(value)->IsObject(); }

bool value_array_length(const void* value, size_t* length)
{
    if (!value || !value_at(value)->IsArray()) { return false; }
    *length = value_at(value)->ArrayLen();
    return true;
}

bool value_number(const void* value, double* number)
{
    if (!value || !value_at(value)->IsNumber()) { return false; }
    *number = value_at(value)->GetNumberAsDouble();
    return true;
}

bool value_boolean(const void* value, bool* boolean)
{
    if (!value || !value_at(value)->IsBool()) { return false; }
    *boolean = value_at(value)->Get<bool>();
    return true;
}

const char* value_string(const void* value)
{
    return value && value_at(value)->IsString() ? value_at(value)->Get<std::string>().c_str() : nullptr;
}

const es_gltf_values gltf_values = {value_member, value_element, value_is_object, value_array_length, value_number, value_boolean, value_string};

/* The caller's floating-point environment comes back on every way out. */
struct fp_scope {
    es_fp_environment saved = es_fp_enter_untrapped();
    ~fp_scope() { es_fp_leave(saved); }
};

uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    return bits;
}

/* ---- accessors after their check -------------------------------------------------------------------------------------- */

struct elements {
    const uint8_t* data = nullptr; /* nullptr: zeros */
    size_t stride = 0, count = 0;
    int components = 0, type = 0;
    bool normalized = false;
    const uint8_t *sparse_indices = nullptr, *sparse_values = nullptr;
    size_t sparse_count = 0;
    int sparse_type = 0;
};

size_t component_bytes(int type)
{
    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT: return 4;
    default: return 0;
    }
}

/* Elements begin where the file says, at any address: memcpy. All hosts of this library are little-endian, as glTF is. */
template <class T> T load(const uint8_t* at)
{
    T value;
    memcpy(&value, at, sizeof value);
    return value;
}

/* §3.11: normalised integers to [0, 1] and [-1, 1] */
float load_float(const uint8_t* at, int type, bool normalized)
{
    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_FLOAT: return load<float>(at);
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
        float value = static_cast<float>(load<int8_t>(at));
        return normalized ? std::max(value / 127.0f, -1.0f) : value;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: {
        float value = static_cast<float>(*at);
        return normalized ? value / 255.0f : value;
    }
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
        float value = static_cast<float>(load<int16_t>(at));
        return normalized ? std::max(value / 32767.0f, -1.0f) : value;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
        float value = static_cast<float>(load<uint16_t>(at));
        return normalized ? value / 65535.0f : value;
    }
    default: return static_cast<float>(load<uint32_t>(at));
    }
}

uint32_t load_unsigned(const uint8_t* at, int type)
{
    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return *at;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return load<uint16_t>(at);
    default: return load<uint32_t>(at);
    }
}

/* ---- a primitive's geometry on its way into the world --------------------------------------------------------------------- */

struct geometry {
    list<float> positions, normals, tangents, uv0, uv1, colors;
    list<uint32_t> indices;
    std::vector<list<float>> targets; /* displacements of positions, normals and tangents of one target after another; empty: none */
    explicit geometry(es_context* c)
        : positions(counted<float>(c)), normals(counted<float>(c)), tangents(counted<float>(c)), uv0(counted<float>(c)),
          uv1(counted<float>(c)), colors(counted<float>(c)), indices(counted<uint32_t>(c))
    {
    }
};

/* What is warned of once per file, after it was read. */
struct left_out {
    size_t lines_and_points = 0, partial_triangles = 0, sheared = 0;
    size_t tinted_specular = 0, specular_textures = 0, transmission_textures = 0, sourceless_textures = 0, uv_sets = 0, dropped_channels = 0, dropped_pointers = 0, weightless = 0;
    std::string sheared_name, pointer_name;
    bool light = false, camera = false; /* and was added */
};

class importer
{
  public:
    importer(es_context* c, const char* p) : context(c), path(p), resources(counted<resource>(c)), element_list(counted<elements>(c)) {}
    importer(const importer&) = delete;
    importer& operator=(const importer&) = delete;
    ~importer()
    {
        for (resource& each : resources) { es_release(context, each.owned, each.owned_size); }
        es_gltf_document_free(context, &document);
        es_gltf_file_close(&file);
        es_world_destroy(world);
        es_unreserve(context, reserved);
    }

    es_world* run(const es_world_settings* given)
    {
        check(es_world_create(context, given, &world));
        settings = given ? *given : es_default_world_settings();
        check(es_gltf_file_open(context, path, &file));
        check(es_gltf_document_read(&file, &document));
        reserve(structure_bytes());
        parse();
        load_buffers();
        check_views();
        for (size_t i = 0; i < model.accessors.size(); i++) { element_list.push_back(checked_accessor(i)); }
        check_nodes();
        choose_roots();
        add_nodes();
        find_weighted_nodes();
        add_instances();
        add_lights();
        add_environment();
        add_cameras();
        add_clips();
        add_physics();
        check(es_edits_import(world, path, file.json, file.json_size));
        check(es_world_finish_opening(world));
        warn_of_left_out();
        es_world* finished = world;
        world = nullptr;
        return finished;
    }

  private:
    struct resource {
        const uint8_t* data;
        size_t size;
        uint8_t* owned;
        size_t owned_size;
    };

    es_context* context;
    const char* path;
    es_gltf_file file{};
    es_gltf_document document{};
    tinygltf::Model model;
    es_world* world = nullptr;
    es_world_settings settings{};
    list<resource> resources;
    list<elements> element_list;
    std::vector<int> parents, order, roots; /* order: the scene's nodes, parents first */
    std::vector<es_transform> transforms;
    std::vector<es_mat4> globals;           /* of all nodes of the file, in their initial pose */
    std::vector<es_node> nodes;             /* null: not in the scene */
    std::vector<es_material> materials;     /* null: not yet made; the last is glTF's default material */
    std::map<std::pair<int, bool>, es_texture> textures; /* by image and sRGB */
    std::map<std::vector<int64_t>, es_mesh> meshes;      /* by everything a primitive's vertices come from */
    std::set<size_t> weighted_nodes;        /* whose morph weights an animation moves: their meshes are shared with no other node */
    std::map<size_t, std::vector<es_mesh>> node_meshes, morphed_meshes; /* by node */
    std::map<size_t, std::vector<es_light>> lights;          /* by number in the file */
    std::map<size_t, std::vector<es_camera>> cameras;
    uint64_t vertex_total = 0, elements_read = 0;
    size_t instance_total = 0;
    size_t reserved = 0;                    /* of the context's count, for what tinygltf and the containers here allocate by themselves */
    left_out left;

    /* ---- messages ------------------------------------------------------------------------------------------------------------ */

    [[noreturn]] ES_PRINTF(3, 4) void refuse(es_result result, const char* format, ...)
    {
        char text[400];
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(text, sizeof text, format, arguments);
        va_end(arguments);
        es_fail(context, result, "%s: %s", path, text);
        throw refusal{result};
    }

    ES_PRINTF(2, 3) void warn(const char* format, ...)
    {
        char text[400];
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(text, sizeof text, format, arguments);
        va_end(arguments);
        es_log(context, ES_LOG_WARNING, ES_ASSET_WARNING, "%s: %s", path, text);
    }

    void check(es_result result)
    {
        if (result != ES_OK) { throw refusal{result}; }
    }

    static std::string shown(const std::string& text)
    {
        char buffer[ES_GLTF_PRINTABLE];
        return es_gltf_printable(text.data(), text.size(), buffer);
    }

    /* A number of the file as float, within [low, high]. */
    float number(double value, double low, double high, const std::string& where)
    {
        if (!(value >= low && value <= high)) {
            refuse(ES_FILE_DAMAGED, "%s: is %g, must lie in %g … %g", where.c_str(), value, low, high);
        }
        return static_cast<float>(value);
    }

    /* An index into `count` things. */
    size_t index(int value, size_t count, const std::string& where)
    {
        if (value < 0 || static_cast<size_t>(value) >= count) {
            refuse(ES_FILE_DAMAGED, "%s: names number %d, there are %zu", where.c_str(), value, count);
        }
        return static_cast<size_t>(value);
    }

    static std::string at(const char* section, size_t i) { return std::string(section) + "[" + std::to_string(i) + "]"; }

    /* ---- memory that is not the context's ------------------------------------------------------------------------------------- */

    void reserve(uint64_t bytes)
    {
        if (!es_reserve(context, static_cast<size_t>(bytes))) { throw refusal{es_context_last_result(context)}; }
        reserved += static_cast<size_t>(bytes);
    }

    /* tinygltf keeps the parsed text and its structures side by side. Measured on files of 300,000 items each (x86-64, libstdc++), items
     * took up to 200 bytes as values, 300 as members of objects, 910 as objects of glTF and 3840 as materials. */
    uint64_t structure_bytes() const
    {
        return 2 * static_cast<uint64_t>(document.text_size) + 320 * static_cast<uint64_t>(document.value_count) +
            1000 * static_cast<uint64_t>(document.object_count) + 4000 * static_cast<uint64_t>(document.material_count);
    }

    /* ---- text to structures --------------------------------------------------------------------------------------------------- */

    void parse()
    {
        tinygltf::TinyGLTF parser;
        /* the text names no buffers and no images: nothing is read through these */
        parser.SetFsCallbacks({[](const std::string&, void*) { return false; }, [](const std::string& name, void*) { return name; },
            [](std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; },
            [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) { return false; }, nullptr});
        std::string error, warning;
        bool parsed = parser.LoadASCIIFromString(&model, &error, &warning, document.text, static_cast<unsigned int>(document.text_size), "");
        error = shown(error.substr(0, error.find('\n')));
        if (!parsed) { refuse(ES_FILE_DAMAGED, "%s", error.empty() ? "cannot be parsed" : error.c_str()); }
        es_release(context, document.text, document.text_capacity);
        document.text = nullptr;
        document.text_size = document.text_capacity = 0;

        /* a primitive that tinygltf cannot parse is missing from its list, which shifts the others */
        std::vector<size_t> counts(model.meshes.size(), 0);
        for (size_t i = 0; i < document.primitive_count; i++) {
            if (document.primitives[i].mesh < counts.size()) { counts[document.primitives[i].mesh]++; }
        }
        size_t entry = 0;
        for (size_t m = 0; m < model.meshes.size(); m++) {
            if (counts[m] != model.meshes[m].primitives.size()) {
                refuse(ES_FILE_DAMAGED, "meshes[%zu].primitives: one lacks its attributes, an object of accessor numbers", m);
            }
            for (tinygltf::Primitive& primitive : model.meshes[m].primitives) {
                primitive.indices = static_cast<int>(document.primitives[entry++].indices);
            }
        }
        std::string ignored;
        for (const std::string& extension : model.extensionsUsed) {
            bool known = false;
            for (size_t i = 0; es_gltf_extensions[i]; i++) { known |= extension == es_gltf_extensions[i]; }
            if (!known) { ignored += (ignored.empty() ? "" : ", ") + shown(extension); }
        }
        if (!ignored.empty()) {
            es_log(context, ES_LOG_INFO, ES_NOTE, "%s: optional extensions that are ignored: %.300s", path, ignored.c_str());
        }
    }

    /* ---- §3.6: buffers, views, accessors -------------------------------------------------------------------------------------- */

    void load_buffers()
    {
        for (size_t i = 0; i < document.buffer_count; i++) {
            const es_gltf_resource& buffer = document.buffers[i];
            resource loaded{nullptr, static_cast<size_t>(buffer.byte_length), nullptr, 0};
            if (buffer.byte_length == 0) { refuse(ES_FILE_DAMAGED, "buffers[%zu].byteLength: is absent or 0, must be 1 or more", i); }
            if (buffer.uri) {
                std::string where = at("buffers", i) + ".uri";
                check(es_gltf_resource_load(&file, where.c_str(), buffer.uri, buffer.uri_size, loaded.size, &loaded.owned, &loaded.owned_size));
                loaded.data = loaded.owned;
            } else if (i == 0 && file.binary) {
                if (buffer.byte_length > file.binary_size) {
                    refuse(ES_FILE_DAMAGED, "buffers[0].byteLength: is %zu, the GLB's BIN chunk has %zu bytes", loaded.size, file.binary_size);
                }
                loaded.data = file.binary;
            } else {
                refuse(ES_FILE_DAMAGED, "buffers[%zu].uri: is absent; only the first buffer of a GLB with a BIN chunk needs none", i);
            }
            try {
                resources.push_back(loaded);
            } catch (...) {
                es_release(context, loaded.owned, loaded.owned_size);
                throw;
            }
        }
    }

    void check_views()
    {
        for (size_t i = 0; i < model.bufferViews.size(); i++) {
            const tinygltf::BufferView& view = model.bufferViews[i];
            const resource& buffer = resources[index(view.buffer, resources.size(), at("bufferViews", i) + ".buffer")];
            if (view.byteLength < 1) { refuse(ES_FILE_DAMAGED, "bufferViews[%zu].byteLength: must be 1 or more", i); }
            if (view.byteOffset > buffer.size || view.byteLength > buffer.size - view.byteOffset) {
                refuse(ES_FILE_DAMAGED, "bufferViews[%zu]: bytes %zu … %zu lie outside of its buffer of %zu bytes", i, view.byteOffset,
                    view.byteOffset + view.byteLength, buffer.size);
            }
        }
    }

    /* Begin of `bytes` bytes at `offset` in a view, or a refusal. */
    const uint8_t* in_view(int view_index, uint64_t offset, uint64_t bytes, const std::string& where)
    {
        const tinygltf::BufferView& view = model.bufferViews[index(view_index, model.bufferViews.size(), where + ".bufferView")];
        if (offset > view.byteLength || bytes > view.byteLength - offset) {
            refuse(ES_FILE_DAMAGED, "%s: needs %llu bytes at offset %llu of bufferViews[%d], which has %zu", where.c_str(),
                static_cast<unsigned long long>(bytes), static_cast<unsigned long long>(offset), view_index, view.byteLength);
        }
        return resources[static_cast<size_t>(view.buffer)].data + view.byteOffset + offset;
    }

    elements checked_accessor(size_t i)
    {
        const tinygltf::Accessor& accessor = model.accessors[i];
        std::string where = at("accessors", i);
        elements e;
        e.type = accessor.componentType;
        e.normalized = accessor.normalized;
        e.count = accessor.count;
        size_t bytes = component_bytes(e.type);
        if (bytes == 0) {
            refuse(ES_FILE_DAMAGED, "%s.componentType: is %d, must be 5120 … 5123, 5125 or 5126", where.c_str(), e.type);
        }
        if (e.count < 1) { refuse(ES_FILE_DAMAGED, "%s.count: must be 1 or more", where.c_str()); }
        int columns = 1;
        switch (accessor.type) {
        case TINYGLTF_TYPE_SCALAR: e.components = 1; break;
        case TINYGLTF_TYPE_VEC2: e.components = 2; break;
        case TINYGLTF_TYPE_VEC3: e.components = 3; break;
        case TINYGLTF_TYPE_VEC4: e.components = 4; break;
        case TINYGLTF_TYPE_MAT2: e.components = 4; columns = 2; break;
        case TINYGLTF_TYPE_MAT3: e.components = 9; columns = 3; break;
        default: e.components = 16; columns = 4; break;
        }
        /* each column of a matrix begins at a multiple of four bytes (§3.6.2.4) */
        size_t rows = static_cast<size_t>(e.components / columns), column = rows * bytes;
        if (columns > 1) { column = (column + 3) / 4 * 4; }
        size_t size = column * static_cast<size_t>(columns);
        e.stride = size;
        if (accessor.bufferView >= 0) {
            const tinygltf::BufferView& view =
                model.bufferViews[index(accessor.bufferView, model.bufferViews.size(), where + ".bufferView")];
            if (view.byteStride != 0) { e.stride = view.byteStride; }
            if (e.stride < size) {
                refuse(ES_FILE_DAMAGED, "%s: its elements have %zu bytes, bufferViews[%d].byteStride is %zu", where.c_str(), size,
                    accessor.bufferView, e.stride);
            }
            /* count < 2^31 and stride < 2^8: no overflow */
            e.data = in_view(accessor.bufferView, accessor.byteOffset, static_cast<uint64_t>(e.stride) * (e.count - 1) + size, where);
        } else if (e.count > max_zero_elements) {
            refuse(ES_FILE_UNSUPPORTED, "%s.count: is %zu, an accessor without a bufferView may have %llu elements", where.c_str(), e.count,
                static_cast<unsigned long long>(max_zero_elements));
        }
        if (accessor.sparse.isSparse) {
            std::string sparse = where + ".sparse";
            e.sparse_type = accessor.sparse.indices.componentType;
            e.sparse_count = static_cast<size_t>(std::max(accessor.sparse.count, 0));
            if (e.sparse_count < 1 || e.sparse_count > e.count) {
                refuse(ES_FILE_DAMAGED, "%s.count: is %d, must lie in 1 … %zu", sparse.c_str(), accessor.sparse.count, e.count);
            }
            if (e.sparse_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && e.sparse_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
                e.sparse_type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
                refuse(ES_FILE_DAMAGED, "%s.indices.componentType: is %d, must be 5121, 5123 or 5125", sparse.c_str(), e.sparse_type);
            }
            size_t index_bytes = component_bytes(e.sparse_type);
            e.sparse_indices = in_view(accessor.sparse.indices.bufferView, static_cast<uint64_t>(std::max(accessor.sparse.indices.byteOffset, 0)),
                static_cast<uint64_t>(e.sparse_count) * index_bytes, sparse + ".indices");
            e.sparse_values = in_view(accessor.sparse.values.bufferView, static_cast<uint64_t>(std::max(accessor.sparse.values.byteOffset, 0)),
                static_cast<uint64_t>(e.sparse_count) * size, sparse + ".values");
            uint32_t last = 0;
            for (size_t s = 0; s < e.sparse_count; s++) {
                uint32_t element = load_unsigned(e.sparse_indices + s * index_bytes, e.sparse_type);
                if (element >= e.count || (s > 0 && element <= last)) {
                    refuse(ES_FILE_DAMAGED, "%s.indices: number %zu is %u, must increase and stay below %zu", sparse.c_str(), s, element, e.count);
                }
                last = element;
            }
        }
        return e;
    }

    const elements& accessor(int number, const std::string& where) { return element_list[index(number, element_list.size(), where)]; }

    void spend(uint64_t count, const std::string& where)
    {
        elements_read += count;
        if (elements_read > max_elements_read) {
            refuse(ES_FILE_UNSUPPORTED, "%s: reading it takes more than %llu accessor elements", where.c_str(),
                static_cast<unsigned long long>(max_elements_read));
        }
    }

    /* All elements as floats, `components` each; `where` names the use for messages. Values must be finite and within 1e9. */
    void read_floats(int number, int components, const std::string& where, list<float>& out)
    {
        const elements& e = accessor(number, where);
        if (e.components != components || e.type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
            refuse(ES_FILE_DAMAGED, "%s: accessors[%d] has %d components of type %d, %d of type 5126 or a normalised integer are needed",
                where.c_str(), number, e.components, e.type, components);
        }
        spend(e.count, where);
        size_t n = static_cast<size_t>(components), bytes = component_bytes(e.type);
        out.assign(e.count * n, 0.0f);
        if (e.data) {
            for (size_t i = 0; i < e.count; i++) {
                for (size_t c = 0; c < n; c++) { out[i * n + c] = load_float(e.data + i * e.stride + c * bytes, e.type, e.normalized); }
            }
        }
        for (size_t s = 0; s < e.sparse_count; s++) {
            size_t i = load_unsigned(e.sparse_indices + s * component_bytes(e.sparse_type), e.sparse_type);
            for (size_t c = 0; c < n; c++) { out[i * n + c] = load_float(e.sparse_values + (s * n + c) * bytes, e.type, e.normalized); }
        }
        check_values(out, components, where, number);
    }

    void check_values(const list<float>& values, int components, const std::string& where, int accessor_number)
    {
        for (size_t i = 0; i < values.size(); i++) {
            if (!es_within(values[i], -ES_WORLD_EXTENT, ES_WORLD_EXTENT)) {
                refuse(ES_FILE_DAMAGED, "%s: element %zu of accessors[%d] is %g, must be finite and within ±1e9", where.c_str(),
                    i / static_cast<size_t>(components), accessor_number, static_cast<double>(values[i]));
            }
        }
    }

    void read_indices(int number, size_t vertex_count, const std::string& where, list<uint32_t>& out)
    {
        const elements& e = accessor(number, where);
        if (e.components != 1 || (e.type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && e.type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
                                     e.type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)) {
            refuse(ES_FILE_DAMAGED, "%s: accessors[%d] must be SCALAR of type 5121, 5123 or 5125", where.c_str(), number);
        }
        spend(e.count, where);
        out.assign(e.count, 0);
        size_t bytes = component_bytes(e.type);
        for (size_t i = 0; e.data && i < e.count; i++) { out[i] = load_unsigned(e.data + i * e.stride, e.type); }
        for (size_t s = 0; s < e.sparse_count; s++) {
            out[load_unsigned(e.sparse_indices + s * component_bytes(e.sparse_type), e.sparse_type)] = load_unsigned(e.sparse_values + s * bytes, e.type);
        }
        for (size_t i = 0; i < out.size(); i++) {
            if (out[i] >= vertex_count) {
                refuse(ES_FILE_DAMAGED, "%s: element %zu of accessors[%d] is vertex %u, there are %zu", where.c_str(), i, number, out[i], vertex_count);
            }
        }
    }

    /* ---- §3.5: nodes and scenes ------------------------------------------------------------------------------------------------- */

    void check_nodes()
    {
        size_t count = model.nodes.size();
        parents.assign(count, -1);
        for (size_t i = 0; i < count; i++) {
            for (int child : model.nodes[i].children) {
                size_t c = index(child, count, at("nodes", i) + ".children");
                if (parents[c] >= 0) {
                    refuse(ES_FILE_DAMAGED, "nodes[%zu]: is a child of nodes[%d] and of nodes[%zu], one parent is allowed", c, parents[c], i);
                }
                parents[c] = static_cast<int>(i);
            }
        }
        /* breadth first from all roots of the file: with one parent each, what is not reached lies on or below a loop */
        std::vector<int> all;
        for (size_t i = 0; i < count; i++) {
            if (parents[i] < 0) { all.push_back(static_cast<int>(i)); }
        }
        for (size_t i = 0; i < all.size(); i++) {
            const std::vector<int>& children = model.nodes[static_cast<size_t>(all[i])].children;
            all.insert(all.end(), children.begin(), children.end());
        }
        if (all.size() != count) {
            std::vector<bool> reached(count, false);
            for (int node : all) { reached[static_cast<size_t>(node)] = true; }
            size_t first = static_cast<size_t>(std::find(reached.begin(), reached.end(), false) - reached.begin());
            refuse(ES_FILE_DAMAGED, "nodes[%zu]: its parents form a loop, nodes must form trees", first);
        }
        transforms.resize(count);
        globals.resize(count);
        for (int node : all) {
            size_t n = static_cast<size_t>(node);
            transforms[n] = transform_of(n);
            const es_transform& t = transforms[n];
            es_mat4 local = es_mat4_from_trs(t.translation, t.rotation, t.scale);
            globals[n] = parents[n] < 0 ? local : es_mat4_mul(globals[static_cast<size_t>(parents[n])], local);
        }
    }

    void read_numbers(const std::vector<double>& from, size_t count, const std::string& where, float* out)
    {
        if (from.empty()) { return; }
        if (from.size() != count) { refuse(ES_FILE_DAMAGED, "%s: has %zu numbers, %zu are needed", where.c_str(), from.size(), count); }
        for (size_t i = 0; i < count; i++) { out[i] = number(from[i], -1e9, 1e9, where); }
    }

    es_transform transform_of(size_t n)
    {
        const tinygltf::Node& node = model.nodes[n];
        std::string where = at("nodes", n);
        es_transform t = es_identity_transform();
        if (!node.matrix.empty()) {
            float m[16];
            read_numbers(node.matrix, 16, where + ".matrix", m);
            return decompose(m, n);
        }
        float translation[3] = {0, 0, 0}, rotation[4] = {0, 0, 0, 1}, scale[3] = {1, 1, 1};
        read_numbers(node.translation, 3, where + ".translation", translation);
        read_numbers(node.rotation, 4, where + ".rotation", rotation);
        read_numbers(node.scale, 3, where + ".scale", scale);
        t.translation = {translation[0], translation[1], translation[2]};
        t.rotation = es_quat_normalize({rotation[0], rotation[1], rotation[2], rotation[3]});
        t.scale = {scale[0], scale[1], scale[2]};
        return t;
    }

    /* Matrix to translation, rotation and scale: the scale is the length of the columns, a mirroring goes into x; columns of
     * no length are completed to a frame, since any direction serves a scale of zero. */
    es_transform decompose(const float m[16], size_t n)
    {
        if (std::fabs(m[3]) > 1e-5f || std::fabs(m[7]) > 1e-5f || std::fabs(m[11]) > 1e-5f || std::fabs(m[15] - 1.0f) > 1e-5f) {
            refuse(ES_FILE_DAMAGED, "nodes[%zu].matrix: its last row must be 0 0 0 1", n);
        }
        double axis[3][3], length[3];
        for (int c = 0; c < 3; c++) {
            double x = m[4 * c], y = m[4 * c + 1], z = m[4 * c + 2];
            length[c] = std::sqrt(x * x + y * y + z * z);
            double inverse = length[c] > 0 ? 1.0 / length[c] : 0.0;
            axis[c][0] = x * inverse;
            axis[c][1] = y * inverse;
            axis[c][2] = z * inverse;
        }
        auto dot = [&](int a, int b) { return axis[a][0] * axis[b][0] + axis[a][1] * axis[b][1] + axis[a][2] * axis[b][2]; };
        auto cross = [&](int a, int b, int to) {
            double x = axis[a][1] * axis[b][2] - axis[a][2] * axis[b][1], y = axis[a][2] * axis[b][0] - axis[a][0] * axis[b][2];
            double z = axis[a][0] * axis[b][1] - axis[a][1] * axis[b][0];
            axis[to][0] = x;
            axis[to][1] = y;
            axis[to][2] = z;
        };
        auto normalize = [&](int a) {
            double l = std::sqrt(dot(a, a));
            for (double& each : axis[a]) { each /= l; }
        };
        if (std::fabs(dot(0, 1)) > shear_tolerance || std::fabs(dot(1, 2)) > shear_tolerance || std::fabs(dot(0, 2)) > shear_tolerance) {
            if (left.sheared++ == 0) { left.sheared_name = at("nodes", n); }
        }
        es_transform t = es_identity_transform();
        t.translation = {m[12], m[13], m[14]};
        t.scale = {static_cast<float>(length[0]), static_cast<float>(length[1]), static_cast<float>(length[2])};
        int zeros = (length[0] == 0) + (length[1] == 0) + (length[2] == 0);
        if (zeros == 3) { return t; }
        if (zeros == 2) {
            int kept = length[0] > 0 ? 0 : length[1] > 0 ? 1 : 2, next = (kept + 1) % 3, last = (kept + 2) % 3;
            int smallest = 0;
            for (int c = 1; c < 3; c++) {
                if (std::fabs(axis[kept][c]) < std::fabs(axis[kept][smallest])) { smallest = c; }
            }
            for (int c = 0; c < 3; c++) { axis[next][c] = c == smallest; }
            cross(kept, next, last);
            normalize(last);
            cross(last, kept, next);
        } else if (zeros == 1) {
            int missing = length[0] == 0 ? 0 : length[1] == 0 ? 1 : 2;
            cross((missing + 1) % 3, (missing + 2) % 3, missing);
            if (dot(missing, missing) < 1e-12) { return t; }
            normalize(missing);
        } else {
            double det = axis[0][0] * (axis[1][1] * axis[2][2] - axis[1][2] * axis[2][1]) -
                         axis[1][0] * (axis[0][1] * axis[2][2] - axis[0][2] * axis[2][1]) +
                         axis[2][0] * (axis[0][1] * axis[1][2] - axis[0][2] * axis[1][1]);
            if (det < 0) {
                t.scale.x = -t.scale.x;
                for (double& each : axis[0]) { each = -each; }
            }
        }
        /* orthonormal by Gram and Schmidt, which changes nothing without shear */
        double along = dot(0, 1);
        for (int c = 0; c < 3; c++) { axis[1][c] -= along * axis[0][c]; }
        if (dot(1, 1) < 1e-12) { return t; }
        normalize(1);
        cross(0, 1, 2);
        t.rotation = rotation_of(axis);
        return t;
    }

    /* Quaternion of a rotation given by its columns, by the largest of its four components (Shepperd 1978). */
    static es_quat rotation_of(const double a[3][3])
    {
        double x = 1 + a[0][0] - a[1][1] - a[2][2], y = 1 - a[0][0] + a[1][1] - a[2][2], z = 1 - a[0][0] - a[1][1] + a[2][2];
        double w = 1 + a[0][0] + a[1][1] + a[2][2];
        double q[4];
        if (w >= x && w >= y && w >= z) {
            q[0] = a[1][2] - a[2][1], q[1] = a[2][0] - a[0][2], q[2] = a[0][1] - a[1][0], q[3] = w;
        } else if (x >= y && x >= z) {
            q[0] = x, q[1] = a[0][1] + a[1][0], q[2] = a[2][0] + a[0][2], q[3] = a[1][2] - a[2][1];
        } else if (y >= z) {
            q[0] = a[0][1] + a[1][0], q[1] = y, q[2] = a[1][2] + a[2][1], q[3] = a[2][0] - a[0][2];
        } else {
            q[0] = a[2][0] + a[0][2], q[1] = a[1][2] + a[2][1], q[2] = z, q[3] = a[0][1] - a[1][0];
        }
        double inverse = 1.0 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        return {static_cast<float>(q[0] * inverse), static_cast<float>(q[1] * inverse), static_cast<float>(q[2] * inverse),
            static_cast<float>(q[3] * inverse)};
    }

    void choose_roots()
    {
        if (model.scenes.empty()) {
            /* a library of parts: show all of it */
            for (size_t i = 0; i < parents.size(); i++) {
                if (parents[i] < 0) { roots.push_back(static_cast<int>(i)); }
            }
        } else {
            size_t scene = model.defaultScene < 0 ? 0 : index(model.defaultScene, model.scenes.size(), "scene");
            std::vector<bool> listed(parents.size(), false);
            for (int root : model.scenes[scene].nodes) {
                size_t r = index(root, parents.size(), at("scenes", scene) + ".nodes");
                if (listed[r] || parents[r] >= 0) {
                    refuse(ES_FILE_DAMAGED, "scenes[%zu].nodes: nodes[%d] is %s, each must be a root named once", scene, root,
                        listed[r] ? "named twice" : "a child");
                }
                listed[r] = true;
                roots.push_back(root);
            }
        }
        order = roots;
        for (size_t i = 0; i < order.size(); i++) {
            const std::vector<int>& children = model.nodes[static_cast<size_t>(order[i])].children;
            order.insert(order.end(), children.begin(), children.end());
        }
    }

    void add_nodes()
    {
        nodes.assign(model.nodes.size(), es_node{0});
        for (int each : order) { add_node(static_cast<size_t>(each)); }
    }

    void add_node(size_t n)
    {
        es_node_desc desc{};
        desc.name = model.nodes[n].name.c_str();
        desc.parent = parents[n] < 0 ? es_node{0} : nodes[static_cast<size_t>(parents[n])];
        desc.transform = transforms[n];
        check(es_world_add_node(world, &desc, &nodes[n]));
    }

    /* Joints may lie outside of the scene that is shown. */
    es_node node_of_joint(size_t n)
    {
        std::vector<size_t> missing;
        for (int each = static_cast<int>(n); each >= 0 && nodes[static_cast<size_t>(each)].id == 0; each = parents[static_cast<size_t>(each)]) {
            missing.push_back(static_cast<size_t>(each));
        }
        for (size_t i = missing.size(); i-- > 0;) { add_node(missing[i]); }
        return nodes[n];
    }

    /* ---- §3.8: images, samplers, textures ------------------------------------------------------------------------------------------ */

    es_texture texture_of_image(size_t i, bool srgb)
    {
        std::pair<int, bool> key(static_cast<int>(i), srgb);
        auto known = textures.find(key);
        if (known != textures.end()) { return known->second; }
        es_texture texture{};
        with_image(i, [&](const es_gltf_image_header& header, const unsigned char* rgba) {
            bool named = document.images[i].uri && memcmp(document.images[i].uri, "data:", std::min<size_t>(5, document.images[i].uri_size)) != 0;
            std::string name = named ? std::string(document.images[i].uri, document.images[i].uri_size) : at("images", i);
            es_texture_desc desc{name.c_str(), header.width, header.height, rgba, srgb};
            check(es_world_add_texture(world, &desc, &texture));
        });
        textures[key] = texture;
        return texture;
    }

    /* Calls use(header, pixels of four bytes each). */
    template <typename user> void with_image(size_t i, const user& use)
    {
        const es_gltf_resource& image = document.images[i];
        std::string where = at("images", i);
        resource source{nullptr, 0, nullptr, 0};
        if (image.uri && image.buffer_view >= 0) { refuse(ES_FILE_DAMAGED, "%s: has both uri and bufferView, one is needed", where.c_str()); }
        if (image.uri) {
            where += ".uri";
            check(es_gltf_resource_load(&file, where.c_str(), image.uri, image.uri_size, 0, &source.owned, &source.owned_size));
            source.data = source.owned;
            source.size = source.owned_size;
        } else if (image.buffer_view >= 0) {
            const tinygltf::BufferView& view =
                model.bufferViews[index(static_cast<int>(image.buffer_view), model.bufferViews.size(), where + ".bufferView")];
            source.data = in_view(static_cast<int>(image.buffer_view), 0, view.byteLength, where);
            source.size = view.byteLength;
        } else {
            refuse(ES_FILE_DAMAGED, "%s: has neither uri nor bufferView, one is needed", where.c_str());
        }
        try {
            decode(source, where, i, use);
        } catch (...) {
            es_release(context, source.owned, source.owned_size);
            throw;
        }
        es_release(context, source.owned, source.owned_size);
    }

    template <typename user> void decode(const resource& source, const std::string& where, size_t i, const user& use)
    {
        es_gltf_image_header header;
        if (!es_gltf_image_header_read(source.data, source.size, &header)) {
            refuse(ES_FILE_DAMAGED, "%s: is neither a PNG nor a JPEG image", where.c_str());
        }
        if (header.width < 1 || header.height < 1 || header.width > ES_TEXTURE_MAX_SIZE || header.height > ES_TEXTURE_MAX_SIZE) {
            refuse(ES_IMAGE_SIZE, "%s: is an image of %u x %u pixels, each side must lie in 1 … %d", where.c_str(), header.width, header.height,
                ES_TEXTURE_MAX_SIZE);
        }
        /* tinygltf counts bytes in int; its decoder's memory is not the context's, so the cap is asked beforehand: filtered
         * rows, decoded pixels and their copy */
        uint64_t pixels = static_cast<uint64_t>(header.width) * header.height, bytes = pixels * (header.bits / 8) * 4;
        if (bytes > INT32_MAX || source.size > INT32_MAX) {
            refuse(ES_IMAGE_SIZE, "%s: is an image of %u x %u pixels of %u bits, below 2 GiB decoded is read", where.c_str(), header.width,
                header.height, header.bits);
        }
        size_t cap = es_context_resolved_desc(context).memory_cap, used = es_context_bytes(context);
        if (cap > 0 && (used > cap || 3 * bytes > cap - used)) {
            refuse(ES_MEMORY_CAP, "%s: decoding %u x %u pixels takes %llu bytes, the context's cap of %zu leaves %zu", where.c_str(),
                header.width, header.height, static_cast<unsigned long long>(3 * bytes), cap, cap > used ? cap - used : 0);
        }
        struct lent {
            es_context* context;
            size_t bytes;
            ~lent() { es_unreserve(context, bytes); }
        };
        if (!es_reserve(context, static_cast<size_t>(3 * bytes))) { throw refusal{es_context_last_result(context)}; }
        lent pixels_lent{context, static_cast<size_t>(3 * bytes)};
        tinygltf::Image image;
        std::string error, warning;
        bool good = tinygltf::LoadImageData(&image, static_cast<int>(i), &error, &warning, 0, 0, source.data, static_cast<int>(source.size), nullptr);
        size_t sample = image.bits == 16 ? 2 : 1;
        if (!good || image.component != 4 || image.width != static_cast<int>(header.width) || image.height != static_cast<int>(header.height) ||
            image.image.size() != pixels * 4 * sample) {
            refuse(ES_FILE_DAMAGED, "%s: the image cannot be decoded, it is damaged or of an unusual kind of PNG or JPEG", where.c_str());
        }
        if (sample == 2) {
            for (size_t k = 0; k < pixels * 4; k++) {
                uint32_t value = load<uint16_t>(image.image.data() + 2 * k);
                image.image[k] = static_cast<unsigned char>((value * 255u + 32767u) / 65535u);
            }
        }
        use(header, image.image.data());
    }

    static const tinygltf::Value* extension(const tinygltf::ExtensionMap& extensions, const char* name)
    {
        auto found = extensions.find(name);
        return found != extensions.end() && found->second.IsObject() ? &found->second : nullptr;
    }

    static const tinygltf::Value* member(const tinygltf::Value& object, const char* name) { return value_at(value_member(&object, name)); }

    /* A number of an extension; `standard` when it is absent. */
    float extension_number(const tinygltf::Value& object, const char* name, double standard, double low, double high, const std::string& where)
    {
        const tinygltf::Value* value = member(object, name);
        if (!value) { return static_cast<float>(standard); }
        if (!value->IsNumber()) { refuse(ES_FILE_DAMAGED, "%s.%s: must be a number", where.c_str(), name); }
        return number(value->GetNumberAsDouble(), low, high, where + "." + name);
    }

    void extension_numbers(const tinygltf::Value& object, const char* name, size_t count, double low, double high, const std::string& where, float* out)
    {
        const tinygltf::Value* value = member(object, name);
        if (!value) { return; }
        if (!value->IsArray() || value->ArrayLen() != count) {
            refuse(ES_FILE_DAMAGED, "%s.%s: must be an array of %zu numbers", where.c_str(), name, count);
        }
        for (size_t i = 0; i < count; i++) {
            const tinygltf::Value& element = value->Get<tinygltf::Value::Array>()[i];
            if (!element.IsNumber()) { refuse(ES_FILE_DAMAGED, "%s.%s[%zu]: must be a number", where.c_str(), name, i); }
            out[i] = number(element.GetNumberAsDouble(), low, high, where + "." + name);
        }
    }

    static es_wrap wrap_of(int mode)
    {
        return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE ? ES_WRAP_CLAMP : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? ES_WRAP_MIRROR : ES_WRAP_REPEAT;
    }

    es_texture_use texture_use(int texture_index, int tex_coord, const tinygltf::ExtensionMap& extensions, bool srgb, const std::string& where)
    {
        es_texture_use use{};
        if (texture_index < 0) { return use; }
        const tinygltf::Texture& texture = model.textures[index(texture_index, model.textures.size(), where + ".index")];
        if (texture.source < 0) {
            left.sourceless_textures++;
            return use;
        }
        use.matrix[0] = use.matrix[3] = 1.0f;
        if (const tinygltf::Value* transform = extension(extensions, "KHR_texture_transform")) {
            std::string place = where + ".extensions.KHR_texture_transform";
            float scale[2] = {1, 1};
            float angle = extension_number(*transform, "rotation", 0.0, -8192.0, 8192.0, place);
            extension_numbers(*transform, "scale", 2, -1e6, 1e6, place, scale);
            extension_numbers(*transform, "offset", 2, -1e6, 1e6, place, use.offset);
            tex_coord = static_cast<int>(extension_number(*transform, "texCoord", tex_coord, 0.0, 1024.0, place));
            /* translation * rotation * scale; v points down, so a counter-clockwise turn of the coordinates is
             * u' = u cos + v sin, v' = v cos - u sin */
            float c = es_cos(angle), s = es_sin(angle);
            use.matrix[0] = c * scale[0];
            use.matrix[1] = s * scale[1];
            use.matrix[2] = -s * scale[0];
            use.matrix[3] = c * scale[1];
            /* all zero would count as the identity: the smallest number instead gives the same texel */
            if (scale[0] == 0 && scale[1] == 0) { use.matrix[0] = use.matrix[3] = 1e-30f; }
        }
        if (tex_coord > 1) {
            left.uv_sets++;
            return es_texture_use{};
        }
        use.uv_set = static_cast<uint32_t>(tex_coord);
        if (texture.sampler >= 0) {
            const tinygltf::Sampler& sampler =
                model.samplers[index(texture.sampler, model.samplers.size(), at("textures", static_cast<size_t>(texture_index)) + ".sampler")];
            use.wrap_u = wrap_of(sampler.wrapS);
            use.wrap_v = wrap_of(sampler.wrapT);
            use.magnify = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST ? ES_FILTER_NEAREST : ES_FILTER_LINEAR;
            switch (sampler.minFilter) {
            case TINYGLTF_TEXTURE_FILTER_NEAREST: use.minify = ES_FILTER_NEAREST; use.mip = ES_MIP_NONE; break;
            case TINYGLTF_TEXTURE_FILTER_LINEAR: use.mip = ES_MIP_NONE; break;
            case TINYGLTF_TEXTURE_FILTER_NEAREST_MIPMAP_NEAREST: use.minify = ES_FILTER_NEAREST; use.mip = ES_MIP_NEAREST; break;
            case TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_NEAREST: use.mip = ES_MIP_NEAREST; break;
            case TINYGLTF_TEXTURE_FILTER_NEAREST_MIPMAP_LINEAR: use.minify = ES_FILTER_NEAREST; break;
            default: break;
            }
        }
        size_t image = index(texture.source, document.image_count, at("textures", static_cast<size_t>(texture_index)) + ".source");
        es_texture handle = texture_of_image(image, srgb);
        use.image = es_world_texture_image(world, handle);
        return use;
    }

    /* ---- §3.9: materials ------------------------------------------------------------------------------------------------------------ */

    es_material material_of(int number)
    {
        size_t count = model.materials.size(), i = number < 0 ? count : static_cast<size_t>(number);
        materials.resize(count + 1);
        if (materials[i].id == 0) {
            es_material_desc desc = es_default_material_desc();
            if (number < 0) {
                desc.metallic = 1.0f; /* glTF's default material, §3.9.6 */
            } else {
                fill_material(model.materials[i], at("materials", i), desc);
            }
            check(es_world_add_material(world, number < 0 ? "default" : model.materials[i].name.c_str(), &desc, &materials[i]));
        }
        return materials[i];
    }

    void fill_material(const tinygltf::Material& from, const std::string& where, es_material_desc& desc)
    {
        const tinygltf::PbrMetallicRoughness& pbr = from.pbrMetallicRoughness;
        std::string pbr_where = where + ".pbrMetallicRoughness";
        auto raw = from.values.find("baseColorFactor");
        if (raw != from.values.end() && raw->second.number_array.size() != 4) {
            refuse(ES_FILE_DAMAGED, "%s.baseColorFactor: must be an array of 4 numbers", pbr_where.c_str());
        }
        for (size_t c = 0; c < 4; c++) { desc.base_color[c] = number(pbr.baseColorFactor[c], 0.0, 1.0, pbr_where + ".baseColorFactor"); }
        desc.metallic = number(pbr.metallicFactor, 0.0, 1.0, pbr_where + ".metallicFactor");
        desc.roughness = number(pbr.roughnessFactor, 0.0, 1.0, pbr_where + ".roughnessFactor");
        desc.double_sided = from.doubleSided;
        desc.normal_scale = number(from.normalTexture.scale, -1000.0, 1000.0, where + ".normalTexture.scale");
        float strength = 1.0f;
        if (const tinygltf::Value* emissive = extension(from.extensions, "KHR_materials_emissive_strength")) {
            strength = extension_number(*emissive, "emissiveStrength", 1.0, 0.0, 1e9, where + ".extensions.KHR_materials_emissive_strength");
        }
        for (size_t c = 0; c < 3; c++) {
            /* above 1 is against the standard, yet a common way to say what KHR_materials_emissive_strength is for */
            float radiance = number(from.emissiveFactor[c], 0.0, 1e9, where + ".emissiveFactor") * strength;
            desc.emission[c] = es_minf(radiance, ES_WORLD_EXTENT);
        }
        desc.base_color_texture = texture_use(
            pbr.baseColorTexture.index, pbr.baseColorTexture.texCoord, pbr.baseColorTexture.extensions, true, pbr_where + ".baseColorTexture");
        if (from.alphaMode == "MASK") {
            desc.alpha_mask = true;
            desc.alpha_cutoff = number(from.alphaCutoff, 0.0, 1e9, where + ".alphaCutoff");
        } else if (from.alphaMode == "BLEND") {
            desc.blend = true;
        } else if (from.alphaMode != "OPAQUE") {
            refuse(ES_FILE_DAMAGED, "%s.alphaMode: is '%s', must be OPAQUE, MASK or BLEND", where.c_str(), shown(from.alphaMode).c_str());
        }
        if (extension(from.extensions, "KHR_materials_unlit")) {
            desc.model = ES_SURFACE_UNLIT;
            return;
        }
        desc.metallic_roughness_texture = texture_use(pbr.metallicRoughnessTexture.index, pbr.metallicRoughnessTexture.texCoord,
            pbr.metallicRoughnessTexture.extensions, false, pbr_where + ".metallicRoughnessTexture");
        desc.normal_texture = texture_use(
            from.normalTexture.index, from.normalTexture.texCoord, from.normalTexture.extensions, false, where + ".normalTexture");
        desc.emission_texture = texture_use(
            from.emissiveTexture.index, from.emissiveTexture.texCoord, from.emissiveTexture.extensions, true, where + ".emissiveTexture");
        if (const tinygltf::Value* specular = extension(from.extensions, "KHR_materials_specular")) {
            fill_specular(*specular, where + ".extensions.KHR_materials_specular", desc);
        }
        if (const tinygltf::Value* ior = extension(from.extensions, "KHR_materials_ior")) {
            desc.ior = es_clampf(extension_number(*ior, "ior", 1.5, 0.0, 1e6, where + ".extensions.KHR_materials_ior"), 1.0f, 5.0f);
        }
        if (const tinygltf::Value* transmission = extension(from.extensions, "KHR_materials_transmission")) {
            desc.transmission = extension_number(*transmission, "transmissionFactor", 0.0, 0.0, 1.0, where + ".extensions.KHR_materials_transmission");
            if (member(*transmission, "transmissionTexture")) { left.transmission_textures++; }
        }
    }

    /* The dielectric Fresnel term has one weight for all wavelengths: a tint is folded into it by its Rec. 709 luminance. */
    void fill_specular(const tinygltf::Value& specular, const std::string& where, es_material_desc& desc)
    {
        float color[3] = {1, 1, 1};
        float factor = extension_number(specular, "specularFactor", 1.0, 0.0, 1.0, where);
        extension_numbers(specular, "specularColorFactor", 3, 0.0, 1e6, where, color);
        float luminance = 0.2126f * color[0] + 0.7152f * color[1] + 0.0722f * color[2];
        if (color[0] == 1 && color[1] == 1 && color[2] == 1) { luminance = 1; }
        desc.specular = es_clampf(factor * luminance, 0, 1);
        if (color[0] != color[1] || color[1] != color[2] || factor * luminance > 1) { left.tinted_specular++; }
        if (member(specular, "specularColorTexture")) { left.specular_textures++; }
        const tinygltf::Value* info = member(specular, "specularTexture");
        if (!info || !info->IsObject()) { return; }
        std::string place = where + ".specularTexture";
        if (!member(*info, "index")) { refuse(ES_FILE_DAMAGED, "%s.index: is absent", place.c_str()); }
        int texture = static_cast<int>(extension_number(*info, "index", 0.0, 0.0, 1e9, place));
        int tex_coord = static_cast<int>(extension_number(*info, "texCoord", 0.0, 0.0, 1024.0, place));
        tinygltf::ExtensionMap extensions;
        const tinygltf::Value* all = member(*info, "extensions");
        const tinygltf::Value* transform = all ? member(*all, "KHR_texture_transform") : nullptr;
        if (transform) { extensions["KHR_texture_transform"] = *transform; }
        desc.specular_texture = texture_use(texture, tex_coord, extensions, false, place);
    }

    /* ---- §3.7: meshes ----------------------------------------------------------------------------------------------------------------- */

    void read_attribute(const tinygltf::Primitive& primitive, const char* name, int components, size_t vertex_count, const std::string& where, list<float>& out)
    {
        auto attribute = primitive.attributes.find(name);
        if (attribute == primitive.attributes.end()) { return; }
        std::string place = where + ".attributes." + name;
        read_floats(attribute->second, components, place, out);
        check_count(out.size() / static_cast<size_t>(components), vertex_count, place);
    }

    void check_count(size_t count, size_t vertex_count, const std::string& where)
    {
        if (count != vertex_count) {
            refuse(ES_FILE_DAMAGED, "%s: has %zu elements, POSITION has %zu, they must be equal", where.c_str(), count, vertex_count);
        }
    }

    static int attribute(const tinygltf::Primitive& primitive, const char* name)
    {
        auto found = primitive.attributes.find(name);
        return found == primitive.attributes.end() ? -1 : found->second;
    }

    void read_colors(const tinygltf::Primitive& primitive, size_t vertex_count, const std::string& where, list<float>& out)
    {
        int number = attribute(primitive, "COLOR_0");
        if (number < 0) { return; }
        std::string place = where + ".attributes.COLOR_0";
        const elements& e = accessor(number, place);
        if (e.components != 3 && e.components != 4) { refuse(ES_FILE_DAMAGED, "%s: must be VEC3 or VEC4", place.c_str()); }
        list<float> read{counted<float>(context)};
        read_floats(number, e.components, place, read);
        check_count(e.count, vertex_count, place);
        /* integers stand for [0, 1] whether or not the file remembered to say so */
        float scale = e.type == TINYGLTF_COMPONENT_TYPE_FLOAT || e.normalized ? 1.0f
            : e.type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE                  ? 1.0f / 255.0f
                                                                               : 1.0f / 65535.0f;
        size_t n = static_cast<size_t>(e.components);
        out.assign(e.count * 4, 1.0f);
        for (size_t i = 0; i < e.count; i++) {
            for (size_t c = 0; c < n; c++) { out[4 * i + c] = std::max(read[i * n + c] * scale, 0.0f); }
        }
    }

    /* Triangle corners of strips and fans in glTF's order (§3.7.2.1), so that every triangle faces the same way. */
    void read_triangles(const tinygltf::Primitive& primitive, size_t vertex_count, const std::string& where, list<uint32_t>& out)
    {
        list<uint32_t> corners{counted<uint32_t>(context)};
        if (primitive.indices >= 0) {
            read_indices(primitive.indices, vertex_count, where + ".indices", corners);
        } else {
            corners.assign(vertex_count, 0);
            for (size_t i = 0; i < vertex_count; i++) { corners[i] = static_cast<uint32_t>(i); }
        }
        size_t count = corners.size();
        if (primitive.mode == TINYGLTF_MODE_TRIANGLES) {
            left.partial_triangles += count % 3 != 0;
            corners.resize(count - count % 3);
            out.swap(corners);
            return;
        }
        if (count < 3) {
            left.partial_triangles++;
            return;
        }
        out.assign((count - 2) * 3, 0);
        for (size_t i = 0; i + 2 < count; i++) {
            bool strip = primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP;
            out[3 * i] = strip ? corners[i] : corners[i + 1];
            out[3 * i + 1] = strip ? corners[i + 1 + i % 2] : corners[i + 2];
            out[3 * i + 2] = strip ? corners[i + 2 - i % 2] : corners[0];
        }
    }

    /* §3.7.2.2: displacements of what the primitive itself has */
    void read_targets(const tinygltf::Primitive& primitive, const std::string& where, geometry& g)
    {
        size_t vertex_count = g.positions.size() / 3;
        for (size_t t = 0; t < primitive.targets.size(); t++) {
            std::string target = where + ".targets[" + std::to_string(t) + "].";
            for (size_t k = 0; k < 3; k++) { g.targets.emplace_back(counted<float>(context)); }
            for (const auto& part : primitive.targets[t]) {
                size_t stream = part.first == "POSITION" ? 0 : part.first == "NORMAL" ? 1 : part.first == "TANGENT" ? 2 : 3;
                if (stream == 3 || (stream == 1 && g.normals.empty()) || (stream == 2 && g.tangents.empty())) { continue; }
                list<float>& displacement = g.targets[3 * t + stream];
                const elements& e = accessor(part.second, target + part.first);
                if (!e.data && e.sparse_count == 0 && e.components == 3) { /* all zero: nothing to keep */
                    check_count(e.count, vertex_count, target + part.first);
                    spend(e.count, target + part.first);
                    continue;
                }
                count_vertices(vertex_count, target + part.first);
                read_floats(part.second, 3, target + part.first, displacement);
                check_count(displacement.size() / 3, vertex_count, target + part.first);
            }
        }
    }

    /* §3.7.3: the nodes and weights that move a mesh. The mesh's vertices are written in the axes of the joints' nearest common ancestor, whose
     * movements then move the instance and not its vertices; the node that carries mesh and skin does not count. */
    void add_skin(const tinygltf::Primitive& primitive, size_t skin_index, const std::string& where, size_t vertex_count, es_mesh mesh)
    {
        const tinygltf::Skin& from = model.skins[skin_index];
        std::string skin_where = at("skins", skin_index);
        size_t joint_count = from.joints.size();
        list<float> bind{counted<float>(context)};
        if (from.inverseBindMatrices >= 0) { read_floats(from.inverseBindMatrices, 16, skin_where + ".inverseBindMatrices", bind); }
        spend(joint_count, skin_where);
        list<es_node> joints{counted<es_node>(context)};
        list<es_mat4> binds{counted<es_mat4>(context)};
        for (size_t j = 0; j < joint_count; j++) {
            joints.push_back(node_of_joint(static_cast<size_t>(from.joints[j])));
            es_mat4 inverse = es_mat4_identity();
            if (!bind.empty()) { memcpy(inverse.m, &bind[16 * j], sizeof inverse.m); }
            binds.push_back(inverse);
        }
        list<uint32_t> vertex_joints{counted<uint32_t>(context)};
        list<float> vertex_weights{counted<float>(context)};
        size_t sets = 0;
        while (attribute(primitive, ("JOINTS_" + std::to_string(sets)).c_str()) >= 0) { sets++; }
        vertex_joints.assign(vertex_count * sets * 4, 0);
        vertex_weights.assign(vertex_count * sets * 4, 0.0f);
        for (size_t set = 0; set < sets; set++) {
            list<float> numbers{counted<float>(context)}, weights{counted<float>(context)};
            read_influences(primitive, set, joint_count, skin_where, where, vertex_count, numbers, weights);
            for (size_t k = 0; k < weights.size(); k++) {
                size_t to = k / 4 * sets * 4 + set * 4 + k % 4;
                vertex_weights[to] = weights[k];
                vertex_joints[to] = weights[k] == 0 ? 0 : static_cast<uint32_t>(numbers[k]);
            }
        }
        es_skin_desc desc{};
        desc.name = from.name.c_str();
        desc.mesh = mesh;
        desc.node = carrier_of(skin_index);
        desc.joint_count = static_cast<uint32_t>(joint_count);
        desc.joints = joints.data();
        desc.inverse_binds = binds.data();
        desc.influences = static_cast<uint32_t>(sets * 4);
        desc.vertex_joints = vertex_joints.data();
        desc.vertex_weights = vertex_weights.data();
        es_skin skin;
        check(es_world_add_skin(world, &desc, &skin));
    }

    /* One set of joints and weights, four each per vertex; joints are whole numbers below joint_count where the weight is not zero. */
    void read_influences(const tinygltf::Primitive& primitive, size_t set, size_t joint_count, const std::string& skin_where, const std::string& where,
        size_t vertex_count, list<float>& numbers, list<float>& weights)
    {
        std::string joints_name = "JOINTS_" + std::to_string(set), weights_name = "WEIGHTS_" + std::to_string(set);
        int joint_accessor = attribute(primitive, joints_name.c_str()), weight_accessor = attribute(primitive, weights_name.c_str());
        std::string place = where + ".attributes." + joints_name;
        if (joint_accessor < 0 || weight_accessor < 0) { refuse(ES_FILE_DAMAGED, "%s: a skinned primitive needs it and %s", place.c_str(), weights_name.c_str()); }
        const elements& e = accessor(joint_accessor, place);
        if (e.components != 4 || (e.type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && e.type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT)) {
            refuse(ES_FILE_DAMAGED, "%s: accessors[%d] must be VEC4 of type 5121 or 5123", place.c_str(), joint_accessor);
        }
        check_count(e.count, vertex_count, place);
        read_floats(weight_accessor, 4, where + ".attributes." + weights_name, weights);
        check_count(weights.size() / 4, vertex_count, where + ".attributes." + weights_name);
        read_floats(joint_accessor, 4, place, numbers); /* integers below 2^16 are exact in float */
        float unscaled = !e.normalized ? 1.0f : e.type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ? 255.0f : 65535.0f;
        for (size_t k = 0; k < weights.size(); k++) {
            numbers[k] = std::floor(numbers[k] * unscaled + 0.5f);
            if (weights[k] == 0) { continue; }
            if (numbers[k] >= static_cast<float>(joint_count) || !(weights[k] > 0 && weights[k] <= 1e6f)) {
                refuse(ES_FILE_DAMAGED, "%s: vertex %zu has joint %.0f with weight %g; %s has %zu joints and weights must not be negative", place.c_str(), k / 4,
                    static_cast<double>(numbers[k]), static_cast<double>(weights[k]), skin_where.c_str(), joint_count);
            }
        }
    }

    /* What of a skinned primitive does not depend on whether it has triangles. */
    void check_skin(const tinygltf::Primitive& primitive, size_t skin_index, const std::string& where)
    {
        const tinygltf::Skin& from = model.skins[skin_index];
        std::string skin_where = at("skins", skin_index);
        if (from.joints.empty()) { refuse(ES_FILE_DAMAGED, "%s.joints: must name at least one node", skin_where.c_str()); }
        if (from.joints.size() > ES_SKIN_JOINTS) { refuse(ES_FILE_UNSUPPORTED, "%s.joints: names %zu nodes, at most %d are read", skin_where.c_str(), from.joints.size(), ES_SKIN_JOINTS); }
        for (int joint : from.joints) { index(joint, model.nodes.size(), skin_where + ".joints"); }
        if (from.inverseBindMatrices >= 0) {
            const elements& e = accessor(from.inverseBindMatrices, skin_where + ".inverseBindMatrices");
            if (e.count < from.joints.size()) {
                refuse(ES_FILE_DAMAGED, "%s.inverseBindMatrices: has %zu matrices, there are %zu joints", skin_where.c_str(), e.count, from.joints.size());
            }
        }
        for (size_t set = 0;; set++) {
            std::string joints_name = "JOINTS_" + std::to_string(set), weights_name = "WEIGHTS_" + std::to_string(set);
            bool has_joints = attribute(primitive, joints_name.c_str()) >= 0, has_weights = attribute(primitive, weights_name.c_str()) >= 0;
            if (!has_joints && !has_weights && set > 0) { break; }
            if (!has_joints || !has_weights) {
                refuse(ES_FILE_DAMAGED, "%s.attributes.%s: a skinned primitive needs it and %s", where.c_str(), joints_name.c_str(), weights_name.c_str());
            }
            if (set >= ES_SKIN_INFLUENCES / 4) { refuse(ES_FILE_UNSUPPORTED, "%s.attributes.%s: at most %d sets are read", where.c_str(), joints_name.c_str(), ES_SKIN_INFLUENCES / 4); }
        }
    }

    std::map<size_t, es_node> carriers; /* by skin */

    /* The nearest node that is an ancestor of all joints; null: only the world is. */
    es_node carrier_of(size_t skin_index)
    {
        auto known = carriers.find(skin_index);
        if (known != carriers.end()) { return known->second; }
        auto depth_of = [&](int node) {
            size_t depth = 0;
            for (; node >= 0; node = parents[static_cast<size_t>(node)]) { depth++; }
            return depth;
        };
        const std::vector<int>& joints = model.skins[skin_index].joints;
        int common = parents[static_cast<size_t>(joints[0])];
        size_t common_depth = depth_of(common);
        for (size_t j = 1; j < joints.size() && common >= 0; j++) {
            int other = parents[static_cast<size_t>(joints[j])];
            size_t depth = depth_of(other);
            spend(depth, at("skins", skin_index));
            for (; depth > common_depth; depth--) { other = parents[static_cast<size_t>(other)]; }
            for (; common_depth > depth; common_depth--) { common = parents[static_cast<size_t>(common)]; }
            for (; common != other; common_depth--) {
                common = parents[static_cast<size_t>(common)];
                other = parents[static_cast<size_t>(other)];
            }
        }
        es_node carrier = common < 0 ? es_node{0} : node_of_joint(static_cast<size_t>(common));
        carriers[skin_index] = carrier;
        return carrier;
    }

    void count_vertices(size_t vertex_count, const std::string& where)
    {
        vertex_total += vertex_count;
        if (vertex_total > max_vertices) {
            refuse(ES_FILE_UNSUPPORTED, "%s: with it the meshes and morph targets have %llu vertices, at most %llu are read", where.c_str(),
                static_cast<unsigned long long>(vertex_total), static_cast<unsigned long long>(max_vertices));
        }
    }

    /* Everything of a primitive as the file has it. */
    void read_geometry(const tinygltf::Primitive& primitive, const std::string& where, geometry& g)
    {
        int position = attribute(primitive, "POSITION");
        size_t vertex_count = accessor(position, where + ".attributes.POSITION").count;
        count_vertices(vertex_count, where);
        read_floats(position, 3, where + ".attributes.POSITION", g.positions);
        read_attribute(primitive, "NORMAL", 3, vertex_count, where, g.normals);
        /* without normals the tangents have nothing to be tangent to (§3.7.2.1) */
        if (!g.normals.empty()) { read_attribute(primitive, "TANGENT", 4, vertex_count, where, g.tangents); }
        read_attribute(primitive, "TEXCOORD_0", 2, vertex_count, where, g.uv0);
        read_attribute(primitive, "TEXCOORD_1", 2, vertex_count, where, g.uv1);
        read_colors(primitive, vertex_count, where, g.colors);
        read_triangles(primitive, vertex_count, where, g.indices);
        if (g.indices.size() / 3 > max_vertices) { refuse(ES_FILE_UNSUPPORTED, "%s: has more than 2^27 triangles", where.c_str()); }
    }

    /* A file is good or bad as a whole: meshes that no node shows are read too, and dropped. */
    void check_unused_meshes(const std::vector<bool>& used)
    {
        left_out before = left;
        for (size_t m = 0; m < model.meshes.size(); m++) {
            for (size_t p = 0; !used[m] && p < model.meshes[m].primitives.size(); p++) {
                const tinygltf::Primitive& primitive = model.meshes[m].primitives[p];
                if (!is_triangles(primitive, m, p) || attribute(primitive, "POSITION") < 0) { continue; }
                geometry g(context);
                read_geometry(primitive, primitive_path(m, p), g);
            }
        }
        left = before;
    }

    static std::string primitive_path(size_t m, size_t p) { return at("meshes", m) + ".primitives[" + std::to_string(p) + "]"; }

    bool is_triangles(const tinygltf::Primitive& primitive, size_t m, size_t p)
    {
        if (primitive.mode < TINYGLTF_MODE_POINTS || primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
            refuse(ES_FILE_DAMAGED, "%s.mode: is %d, must lie in 0 … 6", primitive_path(m, p).c_str(), primitive.mode);
        }
        return primitive.mode >= TINYGLTF_MODE_TRIANGLES;
    }

    /* The world's mesh of a primitive; a null handle when it has no triangle. */
    es_mesh mesh_of(size_t n, size_t m, size_t p)
    {
        const tinygltf::Node& node = model.nodes[n];
        bool skinned = node.skin >= 0;
        const tinygltf::Mesh& from = model.meshes[m];
        const tinygltf::Primitive& primitive = from.primitives[p];
        std::string where = primitive_path(m, p);
        std::vector<float> weights(primitive.targets.size(), 0.0f);
        const std::vector<double>& given = node.weights.empty() ? from.weights : node.weights;
        for (size_t t = 0; t < weights.size() && t < given.size(); t++) { weights[t] = number(given[t], -1e6, 1e6, at("meshes", m) + ".weights"); }

        static const char* const names[] = {"POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"};
        bool weighted = !primitive.targets.empty() && weighted_nodes.count(n) > 0; /* vertices that move by themselves are shared with no other node */
        weighted |= value_member(value_member(&node.extras, "earthshine"), "cloth") != nullptr;
        std::vector<int64_t> key{primitive.mode, primitive.indices, weighted ? static_cast<int64_t>(n) : -1};
        for (const char* name : names) { key.push_back(attribute(primitive, name)); }
        for (size_t t = 0; t < weights.size(); t++) {
            key.push_back(bits_of(weights[t]));
            for (size_t a = 0; a < 3; a++) {
                auto part = primitive.targets[t].find(names[a]);
                key.push_back(part == primitive.targets[t].end() ? -1 : part->second);
            }
        }
        if (!skinned) {
            auto known = meshes.find(key);
            if (known != meshes.end()) { return known->second; }
        }

        geometry g(context);
        read_geometry(primitive, where, g);
        if (primitive.targets.size() > ES_MORPH_TARGETS) { refuse(ES_FILE_UNSUPPORTED, "%s.targets: has %zu of them, at most %d are read", where.c_str(), primitive.targets.size(), ES_MORPH_TARGETS); }
        read_targets(primitive, where, g);
        if (skinned) { check_skin(primitive, static_cast<size_t>(node.skin), where); }

        es_mesh mesh{0};
        if (!g.indices.empty()) {
            es_mesh_desc desc{};
            desc.name = from.name.c_str();
            desc.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
            desc.triangle_count = static_cast<uint32_t>(g.indices.size() / 3);
            desc.positions = g.positions.data();
            desc.normals = g.normals.empty() ? nullptr : g.normals.data();
            desc.tangents = g.tangents.empty() ? nullptr : g.tangents.data();
            desc.uv0 = g.uv0.empty() ? nullptr : g.uv0.data();
            desc.uv1 = g.uv1.empty() ? nullptr : g.uv1.data();
            desc.colors = g.colors.empty() ? nullptr : g.colors.data();
            desc.indices = g.indices.data();
            desc.flat_normals = g.normals.empty();
            std::vector<es_morph_target> targets(primitive.targets.size());
            for (size_t t = 0; t < targets.size(); t++) {
                const float** streams[] = {&targets[t].positions, &targets[t].normals, &targets[t].tangents};
                for (size_t k = 0; k < 3; k++) { *streams[k] = g.targets[3 * t + k].empty() ? nullptr : g.targets[3 * t + k].data(); }
            }
            desc.target_count = static_cast<uint32_t>(targets.size());
            desc.targets = targets.data();
            desc.weights = weights.data();
            check(es_world_add_mesh(world, &desc, &mesh));
            if (skinned) { add_skin(primitive, static_cast<size_t>(node.skin), where, desc.vertex_count, mesh); }
        }
        if (!skinned) { meshes[key] = mesh; }
        return mesh;
    }

    void add_instances()
    {
        std::vector<bool> used(model.meshes.size(), false);
        for (int each : order) {
            size_t n = static_cast<size_t>(each);
            const tinygltf::Node& node = model.nodes[n];
            if (node.mesh < 0) { continue; }
            size_t m = index(node.mesh, model.meshes.size(), at("nodes", n) + ".mesh");
            used[m] = true;
            bool skinned = node.skin >= 0;
            es_node carrier = nodes[n];
            if (skinned) {
                size_t skin = index(node.skin, model.skins.size(), at("nodes", n) + ".skin");
                for (int joint : model.skins[skin].joints) { index(joint, model.nodes.size(), at("skins", skin) + ".joints"); }
                carrier = model.skins[skin].joints.empty() ? nodes[n] : carrier_of(skin);
            }
            for (size_t p = 0; p < model.meshes[m].primitives.size(); p++) {
                const tinygltf::Primitive& primitive = model.meshes[m].primitives[p];
                if (!is_triangles(primitive, m, p)) {
                    left.lines_and_points++;
                    continue;
                }
                if (attribute(primitive, "POSITION") < 0) { continue; } /* §3.7.2.1: such a primitive is not drawn */
                if (primitive.material >= 0) { index(primitive.material, model.materials.size(), primitive_path(m, p) + ".material"); }
                es_instance_desc desc{};
                desc.node = carrier;
                desc.mesh = mesh_of(n, m, p);
                if (desc.mesh.id == 0) { continue; }
                node_meshes[n].push_back(desc.mesh);
                if (!primitive.targets.empty()) { morphed_meshes[n].push_back(desc.mesh); }
                desc.material = material_of(primitive.material);
                es_instance instance;
                check(es_world_add_instance(world, &desc, &instance));
                instance_total++;
            }
        }
        check_unused_meshes(used);
    }

    /* ---- KHR_lights_punctual ------------------------------------------------------------------------------------------------------------ */

    void add_lights()
    {
        size_t count = 0;
        for (int each : order) {
            size_t n = static_cast<size_t>(each);
            const tinygltf::Value* use = extension(model.nodes[n].extensions, "KHR_lights_punctual");
            if (!use) { continue; }
            std::string where = at("nodes", n) + ".extensions.KHR_lights_punctual";
            const tinygltf::Value* light = member(*use, "light");
            if (!light || !light->IsInt()) { refuse(ES_FILE_DAMAGED, "%s.light: must be a whole number", where.c_str()); }
            add_light(index(light->GetNumberAsInt(), model.lights.size(), where + ".light"), nodes[n]);
            count++;
        }
        if (count == 0) { needs_light = settings.default_light; }
    }

    /* ---- EXT_lights_image_based ------------------------------------------------------------------------------------------------------------ */

    struct cube : es_gltf_environment {
        ~cube() { es_gltf_environment_free(this); }
    };

    void add_environment()
    {
        if (model.scenes.empty()) { return; }
        cube from{};
        from.context = context;
        from.path = path;
        from.values = &gltf_values;
        from.scene = model.defaultScene < 0 ? 0 : index(model.defaultScene, model.scenes.size(), "scene");
        from.use = extension(model.scenes[from.scene].extensions, "EXT_lights_image_based");
        from.root = extension(model.extensions, "EXT_lights_image_based");
        from.image_count = document.image_count;
        if (!from.use) { return; }
        check(es_gltf_environment_read(&from));
        for (size_t face = 0; face < 6; face++) {
            with_image(from.images[face], [&](const es_gltf_image_header& header, const unsigned char* rgba) { check(es_gltf_environment_face(&from, face, &header, rgba)); });
        }
        check(es_gltf_environment_set(&from, world));
        if (from.intensity > 0.0f) { needs_light = false; }
    }

    bool needs_light = false;

    void add_light(size_t i, es_node node)
    {
        const tinygltf::Light& from = model.lights[i];
        std::string where = at("extensions.KHR_lights_punctual.lights", i);
        es_light_desc desc = es_default_light_desc();
        desc.name = from.name.c_str();
        desc.node = node;
        desc.intensity = number(from.intensity, 0.0, 1e12, where + ".intensity");
        if (!from.color.empty()) {
            if (from.color.size() != 3) { refuse(ES_FILE_DAMAGED, "%s.color: has %zu numbers, 3 are needed", where.c_str(), from.color.size()); }
            for (size_t c = 0; c < 3; c++) { desc.color[c] = number(from.color[c], 0.0, 1e6, where + ".color"); }
        }
        desc.range = number(from.range, 0.0, 1e12, where + ".range");
        if (from.type == "directional") {
            desc.type = ES_LIGHT_DIRECTIONAL;
            desc.range = 0;
        } else if (from.type == "point") {
            desc.type = ES_LIGHT_POINT;
        } else if (from.type == "spot") {
            desc.type = ES_LIGHT_SPOT;
            /* a right angle written with a few digits may lie beyond it by its rounding */
            desc.outer_cone = std::min(number(from.spot.outerConeAngle, 0.0, 1.5708, where + ".spot.outerConeAngle"), 0.5f * ES_PI);
            desc.outer_cone = std::max(desc.outer_cone, 1e-4f);
            desc.inner_cone = std::min(number(from.spot.innerConeAngle, 0.0, 1.5708, where + ".spot.innerConeAngle"), desc.outer_cone);
        } else {
            refuse(ES_FILE_DAMAGED, "%s.type: is '%s', must be directional, point or spot", where.c_str(), shown(from.type).c_str());
        }
        es_light light;
        check(es_world_add_light(world, &desc, &light));
        lights[i].push_back(light);
    }

    /* Directional, from above the left shoulder of a camera with these axes (right, up, back). */
    void add_default_light(es_vec3 right, es_vec3 up, es_vec3 back)
    {
        es_vec3 towards = es_v3_normalize({0.7f * back.x + 0.9f * up.x - 0.6f * right.x, 0.7f * back.y + 0.9f * up.y - 0.6f * right.y,
                                              0.7f * back.z + 0.9f * up.z - 0.6f * right.z},
            {0, 1, 0});
        es_node_desc node_desc{};
        node_desc.name = "default light";
        node_desc.transform = es_identity_transform();
        node_desc.transform.rotation = looking_back(towards);
        es_light_desc desc = es_default_light_desc();
        desc.name = "default light";
        desc.type = ES_LIGHT_DIRECTIONAL;
        desc.intensity = 3.0f;
        check(es_world_add_node(world, &node_desc, &desc.node));
        es_light light;
        check(es_world_add_light(world, &desc, &light));
        left.light = true;
    }

    /* Rotation that turns z to the unit vector `back`, with y as upright as it can be. */
    static es_quat looking_back(es_vec3 back)
    {
        es_vec3 helper = std::fabs(back.y) < 0.999f ? es_vec3{0, 1, 0} : es_vec3{0, 0, -1};
        es_vec3 right = es_v3_normalize(es_v3_cross(helper, back), {1, 0, 0});
        es_vec3 up = es_v3_cross(back, right);
        double axis[3][3] = {{right.x, right.y, right.z}, {up.x, up.y, up.z}, {back.x, back.y, back.z}};
        return rotation_of(axis);
    }

    /* ---- §3.10: cameras --------------------------------------------------------------------------------------------------------------------- */

    void add_cameras()
    {
        /* numbered by the file's list of cameras, then by node */
        std::vector<std::pair<size_t, size_t>> uses;
        for (int each : order) {
            size_t n = static_cast<size_t>(each);
            if (model.nodes[n].camera >= 0) {
                uses.emplace_back(index(model.nodes[n].camera, model.cameras.size(), at("nodes", n) + ".camera"), n);
            }
        }
        std::sort(uses.begin(), uses.end());
        for (const auto& use : uses) { add_camera(use.first, nodes[use.second]); }
        if (uses.empty()) {
            add_framing_camera();
        } else if (needs_light) {
            size_t chosen = std::min<size_t>(settings.camera, uses.size() - 1);
            const float* m = globals[uses[chosen].second].m;
            add_default_light(es_v3_normalize({m[0], m[1], m[2]}, {1, 0, 0}), es_v3_normalize({m[4], m[5], m[6]}, {0, 1, 0}),
                es_v3_normalize({m[8], m[9], m[10]}, {0, 0, 1}));
        }
    }

    void add_camera(size_t i, es_node node)
    {
        const tinygltf::Camera& from = model.cameras[i];
        std::string where = at("cameras", i);
        es_camera_desc desc = es_default_camera_desc();
        desc.name = from.name.c_str();
        desc.node = node;
        if (from.type == "orthographic") {
            where += ".orthographic";
            desc.orthographic = true;
            desc.half_height = number(std::fabs(from.orthographic.ymag), 1e-6, 1e9, where + ".ymag");
            desc.near_plane = number(from.orthographic.znear, 0.0, 1e6, where + ".znear");
            desc.far_plane = number(from.orthographic.zfar, 1e-6, 1e9, where + ".zfar");
            if (!(desc.far_plane > desc.near_plane)) { refuse(ES_FILE_DAMAGED, "%s.zfar: must lie beyond znear", where.c_str()); }
        } else {
            where += ".perspective";
            desc.fov_y = number(from.perspective.yfov, 0.001, 3.115, where + ".yfov");
            desc.near_plane = number(from.perspective.znear, 1e-6, 1e6, where + ".znear");
        }
        es_camera camera;
        check(es_world_add_camera(world, &desc, &camera));
        cameras[i].push_back(camera);
    }

    /* Looks at the middle of everything from a little to the right and above, far enough for its bounding sphere. */
    void add_framing_camera()
    {
        es_vec3 low{-1, -1, -1}, high{1, 1, 1};
        es_world_bounds(world, &low, &high);
        es_vec3 middle = es_v3_scale(es_v3_add(low, high), 0.5f);
        float radius = 0.5f * es_v3_length(es_v3_sub(high, low));
        radius = es_clampf(radius, 1e-4f, 1e8f);
        es_camera_desc desc = es_default_camera_desc();
        es_vec3 back = es_v3_normalize({0.45f, 0.35f, 1.0f}, {0, 0, 1});
        float distance = radius / es_sin(0.5f * desc.fov_y);
        es_node_desc node_desc{};
        node_desc.name = "framing camera";
        node_desc.transform = es_identity_transform();
        node_desc.transform.translation = es_v3_add(middle, es_v3_scale(back, distance));
        node_desc.transform.rotation = looking_back(back);
        desc.name = "framing camera";
        desc.near_plane = es_clampf(0.01f * radius, 1e-6f, 1e6f);
        check(es_world_add_node(world, &node_desc, &desc.node));
        es_camera camera;
        check(es_world_add_camera(world, &desc, &camera));
        left.camera = true;
        if (needs_light) {
            es_quat q = node_desc.transform.rotation;
            add_default_light(es_quat_rotate(q, {1, 0, 0}), es_quat_rotate(q, {0, 1, 0}), back);
        }
    }

    /* ---- §3.11: animations -------------------------------------------------------------------------------------------------------------------- */

    /* What an animation's channel moves: a node's own path, or a KHR_animation_pointer. */
    enum class moved { nothing, node, light, camera };
    struct channel_target {
        moved kind = moved::nothing;
        size_t number = 0;
        es_clip_path path = ES_CLIP_TRANSLATION;
        bool operator<(const channel_target& other) const
        {
            return std::make_tuple(kind, number, path) < std::make_tuple(other.kind, other.number, other.path);
        }
    };

    static bool node_path(const std::string& name, es_clip_path& path)
    {
        static const struct { const char* name; es_clip_path path; } paths[] = {{"translation", ES_CLIP_TRANSLATION}, {"rotation", ES_CLIP_ROTATION},
            {"scale", ES_CLIP_SCALE}, {"weights", ES_CLIP_WEIGHTS}};
        for (const auto& each : paths) {
            if (name == each.name) {
                path = each.path;
                return true;
            }
        }
        return false;
    }

    /* A whole number and what follows its slash; false when `text` does not begin so. */
    static bool take_number(std::string& text, size_t& number)
    {
        size_t digits = 0;
        number = 0;
        while (digits < text.size() && digits < 9 && text[digits] >= '0' && text[digits] <= '9') { number = number * 10 + static_cast<size_t>(text[digits++] - '0'); }
        if (digits == 0 || digits == text.size() || text[digits] != '/') { return false; }
        text.erase(0, digits + 1);
        return true;
    }

    /* KHR_animation_pointer: where in the file the value lies that is animated. */
    channel_target target_of_pointer(std::string text, const std::string& where)
    {
        static const struct { moved kind; const char* begin; const char* end; es_clip_path path; } pointers[] = {
            {moved::node, "/nodes/", "translation", ES_CLIP_TRANSLATION},
            {moved::node, "/nodes/", "rotation", ES_CLIP_ROTATION},
            {moved::node, "/nodes/", "scale", ES_CLIP_SCALE},
            {moved::node, "/nodes/", "weights", ES_CLIP_WEIGHTS},
            {moved::light, "/extensions/KHR_lights_punctual/lights/", "color", ES_CLIP_LIGHT_COLOR},
            {moved::light, "/extensions/KHR_lights_punctual/lights/", "intensity", ES_CLIP_LIGHT_INTENSITY},
            {moved::light, "/extensions/KHR_lights_punctual/lights/", "spot/innerConeAngle", ES_CLIP_LIGHT_INNER_CONE},
            {moved::light, "/extensions/KHR_lights_punctual/lights/", "spot/outerConeAngle", ES_CLIP_LIGHT_OUTER_CONE},
            {moved::light, "/extensions/KHR_lights_punctual/lights/", "range", ES_CLIP_LIGHT_RANGE},
            {moved::camera, "/cameras/", "perspective/yfov", ES_CLIP_CAMERA_FOV},
            {moved::camera, "/cameras/", "orthographic/ymag", ES_CLIP_CAMERA_HALF_HEIGHT},
            {moved::camera, "/cameras/", "perspective/znear", ES_CLIP_CAMERA_NEAR},
            {moved::camera, "/cameras/", "orthographic/znear", ES_CLIP_CAMERA_NEAR},
        };
        channel_target target;
        for (const auto& each : pointers) {
            std::string rest = text;
            if (rest.compare(0, strlen(each.begin), each.begin) != 0) { continue; }
            rest.erase(0, strlen(each.begin));
            if (!take_number(rest, target.number)) { refuse(ES_FILE_DAMAGED, "%s: '%s' names no object by its number", where.c_str(), shown(text).c_str()); }
            if (rest != each.end) { continue; }
            target.kind = each.kind;
            target.path = each.path;
            size_t count = each.kind == moved::node ? model.nodes.size() : each.kind == moved::light ? model.lights.size() : model.cameras.size();
            index(static_cast<int>(target.number), count, where);
            return target;
        }
        if (text.empty() || text[0] != '/') { refuse(ES_FILE_DAMAGED, "%s: is '%s', must begin with a slash", where.c_str(), shown(text).c_str()); }
        if (left.dropped_pointers++ == 0) { left.pointer_name = shown(text); }
        return channel_target{};
    }

    channel_target target_of(const tinygltf::AnimationChannel& channel, const std::string& where)
    {
        channel_target target;
        if (channel.target_path == "pointer") {
            const tinygltf::Value* use = extension(channel.target_extensions, "KHR_animation_pointer");
            const tinygltf::Value* pointer = use ? member(*use, "pointer") : nullptr;
            std::string place = where + ".target.extensions.KHR_animation_pointer.pointer";
            if (!pointer || !pointer->IsString()) { refuse(ES_FILE_DAMAGED, "%s: is absent or no string", place.c_str()); }
            return target_of_pointer(pointer->Get<std::string>(), place);
        }
        if (channel.target_node < 0) { return target; }
        target.number = index(channel.target_node, model.nodes.size(), where + ".target.node");
        if (node_path(channel.target_path, target.path)) {
            target.kind = moved::node;
        } else {
            left.dropped_channels++; /* things of extensions */
        }
        return target;
    }

    void find_weighted_nodes()
    {
        left_out before = left;
        for (size_t a = 0; a < model.animations.size(); a++) {
            for (size_t c = 0; c < model.animations[a].channels.size(); c++) {
                channel_target target = target_of(model.animations[a].channels[c], at("animations", a) + ".channels[" + std::to_string(c) + "]");
                if (target.kind == moved::node && target.path == ES_CLIP_WEIGHTS) { weighted_nodes.insert(target.number); }
            }
        }
        left = before;
    }

    void add_clips()
    {
        for (size_t a = 0; a < model.animations.size(); a++) { add_clip(a); }
    }

    /* The world's objects that a channel moves, one channel each: a light or camera may hang on several nodes, a mesh have several primitives. */
    std::vector<es_clip_channel> channels_of(const channel_target& target)
    {
        std::vector<es_clip_channel> out;
        es_clip_channel channel{};
        channel.path = target.path;
        if (target.kind == moved::light) {
            for (es_light light : lights[target.number]) {
                channel.light = light;
                es_light_desc desc;
                check(es_world_get_light(world, light, &desc));
                if (target.path == ES_CLIP_LIGHT_RANGE && desc.type == ES_LIGHT_DIRECTIONAL) { continue; }
                out.push_back(channel);
            }
        } else if (target.kind == moved::camera) {
            for (es_camera camera : cameras[target.number]) {
                channel.camera = camera;
                out.push_back(channel);
            }
        } else if (target.path == ES_CLIP_WEIGHTS) {
            for (es_mesh mesh : morphed_meshes[target.number]) {
                channel.mesh = mesh;
                out.push_back(channel);
            }
        } else if (nodes[target.number].id != 0) {
            channel.node = nodes[target.number];
            out.push_back(channel);
        }
        return out;
    }

    void add_clip(size_t a)
    {
        const tinygltf::Animation& from = model.animations[a];
        std::map<int, list<float>> data; /* of accessors, by number */
        std::vector<es_clip_channel> channels;
        std::set<channel_target> targets;
        for (size_t c = 0; c < from.channels.size(); c++) {
            const tinygltf::AnimationChannel& channel = from.channels[c];
            std::string where = at("animations", a) + ".channels[" + std::to_string(c) + "]";
            channel_target target = target_of(channel, where);
            if (target.kind == moved::nothing) { continue; }
            const tinygltf::AnimationSampler& sampler = from.samplers[index(channel.sampler, from.samplers.size(), where + ".sampler")];
            std::vector<es_clip_channel> moving = channels_of(target);
            if (moving.empty()) { /* of another scene, or of a mesh without targets */
                left.weightless += target.path == ES_CLIP_WEIGHTS;
                continue;
            }
            if (!targets.insert(target).second) {
                refuse(ES_FILE_DAMAGED, "%s.target: another channel of the animation has the same target", where.c_str());
            }
            std::string sampler_where = at("animations", a) + ".samplers[" + std::to_string(channel.sampler) + "]";
            es_clip_channel out{};
            if (sampler.interpolation == "STEP") {
                out.interpolation = ES_INTERPOLATE_STEP;
            } else if (sampler.interpolation == "CUBICSPLINE") {
                out.interpolation = ES_INTERPOLATE_CUBIC_SPLINE;
            } else if (sampler.interpolation == "LINEAR") {
                out.interpolation = ES_INTERPOLATE_LINEAR;
            } else {
                refuse(ES_FILE_DAMAGED, "%s.interpolation: is '%s', must be LINEAR, STEP or CUBICSPLINE", sampler_where.c_str(),
                    shown(sampler.interpolation).c_str());
            }
            size_t components = 0; /* numbers per key: of the node's first primitive, which all must have */
            for (const es_clip_channel& each : moving) {
                size_t own = es_clip_components(world, &each);
                if (components != 0 && own != components) { refuse(ES_FILE_DAMAGED, "%s.target: the node's primitives have %zu and %zu morph targets, they must be equal", where.c_str(), components, own); }
                components = own;
            }
            int per_element = target.path == ES_CLIP_WEIGHTS ? 1 : static_cast<int>(components);
            const list<float>& times = animation_data(data, sampler.input, 1, sampler_where + ".input");
            const list<float>& values = animation_data(data, sampler.output, per_element, sampler_where + ".output");
            size_t per_key = components * (out.interpolation == ES_INTERPOLATE_CUBIC_SPLINE ? 3 : 1);
            if (times.size() * per_key != values.size()) {
                refuse(ES_FILE_DAMAGED, "%s.output: has %zu numbers, %zu keys need %zu", sampler_where.c_str(), values.size(), times.size(),
                    times.size() * per_key);
            }
            if (times.size() > 1u << 24) { refuse(ES_FILE_UNSUPPORTED, "%s.input: has %zu keys, at most 2^24 are read", sampler_where.c_str(), times.size()); }
            for (size_t k = 0; k < times.size(); k++) {
                if (!es_within(times[k], 0, 1e6f) || (k > 0 && times[k] <= times[k - 1])) {
                    refuse(ES_FILE_DAMAGED, "%s.input: key %zu of accessors[%d] is at %g s, times must increase within 0 … 1e6", sampler_where.c_str(), k,
                        sampler.input, static_cast<double>(times[k]));
                }
            }
            for (es_clip_channel& each : moving) {
                each.interpolation = out.interpolation;
                each.key_count = static_cast<uint32_t>(times.size());
                each.times = times.data();
                each.values = values.data();
                channels.push_back(each);
            }
        }
        /* an animation without a channel that can be played still has its number */
        es_clip_desc desc{from.name.c_str(), static_cast<uint32_t>(channels.size()), channels.data()};
        es_clip clip;
        check(es_world_add_clip(world, &desc, &clip));
    }

    const list<float>& animation_data(std::map<int, list<float>>& data, int number, int components, const std::string& where)
    {
        const elements& e = accessor(number, where);
        if (e.components != components) {
            refuse(ES_FILE_DAMAGED, "%s: accessors[%d] has %d components, %d are needed", where.c_str(), number, e.components, components);
        }
        auto known = data.find(number);
        if (known != data.end()) { return known->second; }
        list<float> values{counted<float>(context)};
        read_floats(number, components, where, values);
        return data.emplace(number, std::move(values)).first->second;
    }

    /* ---- bodies, joints, cloth ------------------------------------------------------------------------------------------------------------------ */

    void add_physics()
    {
        std::vector<es_gltf_physics_node> all(model.nodes.size());
        std::vector<uint32_t> in_order;
        std::set<size_t> animated;
        left_out before = left; /* what the channels leave out has been counted */
        for (size_t a = 0; a < model.animations.size(); a++) {
            for (size_t c = 0; c < model.animations[a].channels.size(); c++) {
                channel_target target = target_of(model.animations[a].channels[c], at("animations", a) + ".channels[" + std::to_string(c) + "]");
                if (target.kind == moved::node && target.path != ES_CLIP_WEIGHTS) { animated.insert(target.number); }
            }
        }
        left = before;
        for (int each : order) {
            size_t n = static_cast<size_t>(each);
            es_gltf_physics_node& node = all[n];
            node.rigid = extension(model.nodes[n].extensions, "KHR_physics_rigid_bodies");
            node.extras = value_member(&model.nodes[n].extras, "earthshine");
            node.animated = animated.count(n) > 0 || (parents[n] >= 0 && all[static_cast<size_t>(parents[n])].animated);
            in_order.push_back(static_cast<uint32_t>(n));
        }
        for (size_t n = 0; n < all.size(); n++) {
            all[n].node = nodes[n];
            all[n].parent = parents[n];
            all[n].skinned = model.nodes[n].skin >= 0;
            auto meshes_of_node = node_meshes.find(n);
            if (meshes_of_node != node_meshes.end()) {
                all[n].meshes = meshes_of_node->second.data();
                all[n].mesh_count = static_cast<uint32_t>(meshes_of_node->second.size());
            }
        }
        es_gltf_physics physics{};
        physics.context = context;
        physics.world = world;
        physics.path = path;
        physics.values = &gltf_values;
        physics.rigid = extension(model.extensions, "KHR_physics_rigid_bodies");
        physics.shapes = extension(model.extensions, "KHR_implicit_shapes");
        physics.nodes = all.data();
        physics.node_count = static_cast<uint32_t>(all.size());
        physics.order = in_order.data();
        physics.order_count = static_cast<uint32_t>(in_order.size());
        check(es_gltf_physics_add(&physics));
    }

    /* ---- the end -------------------------------------------------------------------------------------------------------------------------------- */

    /* After all else, so that a refusal stands alone. */
    void warn_of_left_out()
    {
        if (left.camera) { es_log(context, ES_LOG_WARNING, ES_NOTE, "%s: has no camera; one that frames everything was added", path); }
        if (left.light) {
            es_log(context, ES_LOG_WARNING, ES_NOTE, "%s: has no light; a directional light of 3 W/m² from above the camera's left shoulder was added (world.default-light=false leaves it out)", path);
        }
        if (left.lines_and_points) { warn("%zu primitives of points or lines are left out, only triangles are drawn", left.lines_and_points); }
        if (left.partial_triangles) { warn("%zu primitives end in an incomplete triangle, which is left out", left.partial_triangles); }
        if (left.dropped_channels) { warn("%zu animation channels with a path other than translation, rotation, scale, weights are left out", left.dropped_channels); }
        if (left.weightless) { warn("%zu animation channels of morph weights are left out, no mesh of the scene has such targets", left.weightless); }
        if (left.dropped_pointers) {
            warn("%zu animated properties are none of those that are animated here, they are left out (the first: %s)", left.dropped_pointers, left.pointer_name.c_str());
        }
        if (left.tinted_specular) { warn("%zu materials have a specular colour, of which only the luminance up to 1 is used", left.tinted_specular); }
        if (left.transmission_textures) { warn("%zu transmission textures are left out: the factor alone counts", left.transmission_textures); }
        if (left.specular_textures) { warn("%zu specular colour textures are left out", left.specular_textures); }
        if (left.sourceless_textures) { warn("%zu textures have no PNG or JPEG image and are left out", left.sourceless_textures); }
        if (left.uv_sets) { warn("%zu textures use a third or later set of coordinates and are left out", left.uv_sets); }
        if (left.sheared) { warn("%zu node matrices have shear, which is left out (the first: %s)", left.sheared, left.sheared_name.c_str()); }
        if (instance_total == 0) { warn("its scene has no triangle: there is nothing to see"); }
    }
};

} // namespace

extern "C" es_result es_world_import_gltf(es_context* context, const char* path, const es_world_settings* settings, es_world** world)
{
    if (!context || !world) { return ES_INVALID_ARGUMENT; }
    *world = nullptr;
    if (!path) { return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_import_gltf: path must not be NULL"); }
    fp_scope environment;
    try {
        importer reader(context, path);
        *world = reader.run(settings);
        return ES_OK;
    } catch (const refusal& refused) {
        return refused.result;
    } catch (const std::bad_alloc&) {
        return es_fail(context, ES_OUT_OF_MEMORY, "%s: there is no memory to read it", path);
    } catch (const std::exception& other) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: %.200s", path, other.what());
    } catch (...) {
        return es_fail(context, ES_FILE_DAMAGED, "%s: cannot be read", path);
    }
}
