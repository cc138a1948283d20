/* This instruction set's kernels. */
#include "raster/kernel_table.h"

#define ES_RASTER_KERNEL_DECLARE(type, name, parameters) type ES_KERNEL(es_##name) parameters;
ES_RASTER_KERNELS(ES_RASTER_KERNEL_DECLARE)

extern const es_raster_kernels ES_KERNEL(es_raster_kernels);
const es_raster_kernels ES_KERNEL(es_raster_kernels) = {
#define ES_RASTER_KERNEL_ENTRY(type, name, parameters) .name = ES_KERNEL(es_##name),
    ES_RASTER_KERNELS(ES_RASTER_KERNEL_ENTRY)
};
