#include "gi/meter.h"

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/maths.h"

typedef struct meter_loop { const es_gi_kernels* kernels; const es_meter_job* job; } meter_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const meter_loop* loop = user;
    loop->kernels->meter(loop->job, begin, end);
}

es_result es_meter_read(es_context* context, const float* const radiance[3], uint32_t width, uint32_t height, uint32_t stride, es_meter* meter)
{
    es_meter_row* sums = es_allocate_array(context, height, sizeof *sums);
    if (!sums) return es_context_last_result(context);
    const es_meter_job job = {{radiance[0], radiance[1], radiance[2]}, width, height, stride, sums};
    es_parallel_for(context, height, 16, rows, &(meter_loop){es_gi_kernel_table(es_context_isa(context)), &job});
    double sum = 0, log_sum = 0;
    for (uint32_t y = 0; y < height; y++) {
        sum += (double)sums[y].sum;
        log_sum += (double)sums[y].log_sum;
    }
    es_release(context, sums, height * sizeof *sums);
    const double pixels = (double)width * height;
    *meter = (es_meter){(float)(sum / pixels) * ES_LUMINOUS_EFFICACY, es_exp2((float)(log_sum / pixels))};
    return ES_OK;
}
