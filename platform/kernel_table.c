/* The platform's kernel tables by instruction set. */
#include "platform/kernel_table.h"
#include "platform/kernel.h"

ES_KERNEL_TABLE(es_platform)
