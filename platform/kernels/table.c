/* This instruction set's table of the platform's kernels. */
#include "platform/kernel_table.h"
#include "platform/kernel.h"

#define DECLARE(name, arguments) void ES_KERNEL(es_platform_##name) arguments;
ES_PLATFORM_KERNELS(DECLARE)

const struct es_platform_kernels ES_KERNEL(es_platform_kernels) = {
#define FIELD(name, arguments) .name = ES_KERNEL(es_platform_##name),
    ES_PLATFORM_KERNELS(FIELD)
};
