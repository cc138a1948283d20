/* This instruction set's table of the light floor's kernels. */
#include "gi/kernel_table.h"
#include "platform/kernel.h"

#define DECLARE(name, arguments) void ES_KERNEL(es_gi_##name) arguments;
ES_GI_KERNELS(DECLARE)

const struct es_gi_kernels ES_KERNEL(es_gi_kernels) = {
#define FIELD(name, arguments) .name = ES_KERNEL(es_gi_##name),
    ES_GI_KERNELS(FIELD)
};
