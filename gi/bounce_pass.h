/* The pass that adds lights of further bounces to the frame's, and shadow maps for them. */
#ifndef EARTHSHINE_GI_BOUNCE_PASS_H
#define EARTHSHINE_GI_BOUNCE_PASS_H

#include "gi/renderer.h"

/* How many lights a frame may have, all bounces together. */
uint32_t es_bounce_capacity(const es_renderer_settings* settings);
/* How many this frame has, once those of the first bounce are placed. */
uint32_t es_bounce_room(const es_renderer* renderer);
/* Are rays to places of lights, by which shadow maps are judged? */
bool es_bounce_wants_rays(const es_renderer_settings* settings);
/* Are the scene's points wanted that reflective maps are drawn from? */
bool es_bounce_wants_points(const es_renderer_settings* settings);
/* Will lamps' light be reflected by lights of a first bounce? Once they are placed. And are rays wanted for that? */
bool es_lamps_bounce(const es_renderer* renderer, const es_frame_inputs* in);
bool es_lamps_bounce_wants_rays(const es_renderer* renderer, const es_frame_inputs* in);
/* After lamps' shadow maps and the hierarchy: adds lights to es_renderer.first_vpls. */
es_result es_pass_lamp_bounce(es_renderer* renderer, const es_frame_inputs* in);
/* After the first bounce's lights, their maps and the hierarchy. Sets es_renderer.vpl_count and what the frame's statistics say of bounces. */
es_result es_pass_bounces(es_renderer* renderer, const es_frame_inputs* in);
/* Of the virtual point lights in the set, how many send the first `bounces` bounces. */
uint32_t es_bounce_end(const es_renderer* renderer, uint32_t bounces);
/* Reflected radiance of bounce n, 1 …: the light of n bounces less that of n - 1, each a multiple of the last place of the whole indirect light
 * first, so that the bounces add up to it to the bit, in any order. With bias compensation, which is of either sign and counts with the first
 * bounce, up to rounding. */
es_result es_bounce_image(es_renderer* renderer, uint32_t bounce, es_image* image);

#endif
