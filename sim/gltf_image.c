/* The size of an image from its header alone, so that nothing is allocated for a file that lies: PNG's IHDR chunk
 * (ISO 15948 §11.2.2) and JPEG's frame header (ITU-T T.81 §B.2.2), the two formats of core glTF. */
#include "sim/gltf_file.h"

#include <string.h>

static uint32_t big_endian(const uint8_t* bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | (uint32_t)bytes[3];
}

bool es_gltf_image_header_read(const uint8_t* bytes, size_t size, es_gltf_image_header* header)
{
    if (size >= 29 && memcmp(bytes, "\x89PNG\r\n\x1a\n", 8) == 0) {
        if (memcmp(bytes + 12, "IHDR", 4) != 0) { return false; }
        *header = (es_gltf_image_header){big_endian(bytes + 16), big_endian(bytes + 20), bytes[24] == 16 ? 16 : 8};
        return true;
    }
    if (size < 4 || bytes[0] != 0xff || bytes[1] != 0xd8) { return false; }
    size_t offset = 2;
    while (offset + 4 <= size) {
        if (bytes[offset] != 0xff) { return false; }
        uint8_t marker = bytes[offset + 1];
        if (marker == 0xff) { /* fill byte */
            offset++;
            continue;
        }
        bool frame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (frame) {
            if (offset + 9 > size) { return false; }
            *header = (es_gltf_image_header){(uint32_t)bytes[offset + 7] << 8 | bytes[offset + 8],
                (uint32_t)bytes[offset + 5] << 8 | bytes[offset + 6], 8};
            return true;
        }
        size_t length = (size_t)bytes[offset + 2] << 8 | bytes[offset + 3];
        if (length < 2) { return false; }
        offset += 2 + length;
    }
    return false;
}
