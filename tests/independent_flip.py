#!/usr/bin/env python3
"""FLIP once more, slowly: prints the values that tests/test_error.c compares the library's with.

Written from the papers, in double precision, with the filters as they are printed there (two-dimensional, not separated) and the
mathematical functions of Python, so it shares neither code nor shortcuts with gi/error:
  Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astroem, Fairchild: FLIP: a difference evaluator for alternating images, HPG 2020
  Andersson, Nilsson, Shirley, Akenine-Moeller: Visualizing errors in rendered high dynamic range images, Eurographics 2021
The two leave the constants of colour conversion open; they are those of the authors' published program.
"""
import math

WHITE = (0.950428545, 1.0, 1.088900371)
TO_XYZ = ((10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794),
          (2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897),
          (1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382))
TO_RGB = ((3.241003275, -1.537398934, -0.498615861),
          (-0.969224334, 1.875930071, 0.041554224),
          (0.055639423, -0.204011202, 1.057148933))


def times(matrix, v):
    return [sum(m * x for m, x in zip(row, v)) for row in matrix]


def ycxcz(rgb):
    x, y, z = (c / w for c, w in zip(times(TO_XYZ, rgb), WHITE))
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def rgb_of_ycxcz(c):
    y = (c[0] + 16) / 116
    x, z = y + c[1] / 500, y - c[2] / 200
    return times(TO_RGB, (x * WHITE[0], y * WHITE[1], z * WHITE[2]))


def hunt_lab(rgb):
    def f(t):
        return t ** (1 / 3) if t > (6 / 29) ** 3 else t / (3 * (6 / 29) ** 2) + 4 / 29
    x, y, z = (f(c / w) for c, w in zip(times(TO_XYZ, rgb), WHITE))
    lightness = 116 * y - 16
    return lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)


def hyab(p, q):
    return abs(p[0] - q[0]) + math.hypot(p[1] - q[1], p[2] - q[2])


def convolve(image, kernel, radius):
    height, width = len(image), len(image[0])
    return [[sum(kernel[j + radius][i + radius] * image[min(max(y + j, 0), height - 1)][min(max(x + i, 0), width - 1)]
                 for j in range(-radius, radius + 1) for i in range(-radius, radius + 1))
             for x in range(width)] for y in range(height)]


def contrast_kernel(terms, ppd):
    radius = math.ceil(3 * math.sqrt(0.04 / (2 * math.pi ** 2)) * ppd)
    offsets = range(-radius, radius + 1)
    kernel = [[sum(a * math.sqrt(math.pi / b) * math.exp(-math.pi ** 2 * (i * i + j * j) / (ppd * ppd * b)) for a, b in terms)
               for i in offsets] for j in offsets]
    total = sum(map(sum, kernel))
    return [[k / total for k in row] for row in kernel], radius


CONTRAST = (((1, 0.0047),), ((1, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))


def feature_kernel(point, ppd):
    deviation = 0.5 * 0.082 * ppd
    radius = math.ceil(3 * deviation)
    offsets = range(-radius, radius + 1)
    kernel = []
    for j in offsets:
        row = []
        for i in offsets:
            g = math.exp(-(i * i + j * j) / (2 * deviation ** 2))
            row.append((i * i / deviation ** 2 - 1) * g if point else -i * g)
        kernel.append(row)
    above = sum(k for row in kernel for k in row if k > 0)
    below = -sum(k for row in kernel for k in row if k < 0)
    return [[k / (above if k > 0 else below) for k in row] for row in kernel], radius


def transposed(kernel):
    return [list(row) for row in zip(*kernel)]


def plane(image, c):
    return [[p[c] for p in row] for row in image]


def features(image, point, ppd):
    kernel, radius = feature_kernel(point, ppd)
    grey = [[(p[0] + 16) / 116 for p in row] for row in image]
    along, down = convolve(grey, kernel, radius), convolve(grey, transposed(kernel), radius)
    return [[math.hypot(a, b) for a, b in zip(*rows)] for rows in zip(along, down)]


def seen(image, ppd):
    planes = [convolve(plane(image, c), *contrast_kernel(CONTRAST[c], ppd)) for c in range(3)]
    return [[hunt_lab([min(max(c, 0), 1) for c in rgb_of_ycxcz(p)]) for p in zip(*rows)] for rows in zip(*planes)]


def flip(a, b, ppd):
    """Linear RGB in [0, 1], rows of pixels."""
    a, b = ([[ycxcz(p) for p in row] for row in image] for image in (a, b))
    largest = hyab(hunt_lab((0, 1, 0)), hunt_lab((0, 0, 1))) ** 0.7
    seen_a, seen_b = seen(a, ppd), seen(b, ppd)
    edges_a, edges_b, points_a, points_b = (features(i, p, ppd) for p in (False, True) for i in (a, b))
    result = []
    for y in range(len(a)):
        row = []
        for x in range(len(a[0])):
            colour = hyab(seen_a[y][x], seen_b[y][x]) ** 0.7
            if colour < 0.4 * largest:
                colour *= 0.95 / (0.4 * largest)
            else:
                colour = 0.95 + (colour - 0.4 * largest) / (0.6 * largest) * 0.05
            feature = max(abs(edges_a[y][x] - edges_b[y][x]), abs(points_a[y][x] - points_b[y][x]))
            row.append(colour ** (1 - math.sqrt(feature / math.sqrt(2))))
        result.append(row)
    return result


ACES = (0.36 * 2.51, 0.6 * 0.03, 0, 0.36 * 2.43, 0.6 * 0.59, 0.14)


def aces(x):
    a, b, c, d, e, f = ACES
    return min(max((a * x * x + b * x + c) / (d * x * x + e * x + f), 0), 1)


def exposures(reference):
    a, b, c, d, e, f = ACES
    p, q, r = a - 0.85 * d, b - 0.85 * e, c - 0.85 * f
    bright = (-q + math.sqrt(q * q - 4 * p * r)) / (2 * p)
    light = sorted(0.2126 * r + 0.7152 * g + 0.0722 * b for row in reference for r, g, b in row)
    half = len(light) // 2
    median = light[half] if len(light) % 2 else (light[half - 1] + light[half]) / 2
    first, last = math.log2(bright / light[-1]), math.log2(bright / median)
    count = max(2, math.ceil(last - first))
    return [first + (last - first) * i / (count - 1) for i in range(count)]


def exposed(image, stops):
    return [[[aces(c * 2 ** stops) for c in p] for p in row] for row in image]


def hdr_flip(a, b, ppd):
    maps = [flip(exposed(a, stops), exposed(b, stops), ppd) for stops in exposures(b)]
    return [[max(m[y][x] for m in maps) for x in range(len(a[0]))] for y in range(len(a))]


def reinhard(image, white=4):
    def shown(p):
        light = 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]
        return [min(c * (1 + light / white ** 2) / (1 + light), 1) for c in p]
    return [[shown(p) for p in row] for row in image]


# ---- the pictures: whole numbers from a small generator, the same in tests/test_error.c --------------------------------------------------

def picture(width, height, seed, high):
    image, state = [], seed
    for y in range(height):
        row = []
        for x in range(width):
            p = []
            for c in range(3):
                state = (state * 1103515245 + 12345) % 2 ** 31
                value = (state >> 16) % 64 / 256 + (x * (c + 1) + y * 3) % 32 / 64 + (0.25 if (x // 5 + y // 4) % 2 else 0)
                p.append(value * (2 ** (high * (x + y * 2) // (width + 2 * height)) / 4) if high else min(value, 1))
            row.append(p)
        image.append(row)
    return image


def report(name, values):
    flat = [v for row in values for v in row]
    width = len(values[0])
    print(f'{name:12} mean {sum(flat) / len(flat):.9f} max {max(flat):.9f} first {flat[0]:.9f} middle {values[len(values) // 2][width // 2]:.9f} last {flat[-1]:.9f}')


if __name__ == '__main__':
    print('largest colour distance to the power of 0.7:', hyab(hunt_lab((0, 1, 0)), hunt_lab((0, 0, 1))) ** 0.7)
    ppd = 0.7 * 3840 / 0.7 * math.pi / 180
    a, b = picture(22, 17, 1, 0), picture(22, 17, 2, 0)
    report('flip', flip(a, b, ppd))
    report('flip 30 ppd', flip(a, b, 30))
    flat = [[[0.25, 0.5, 0.125]] * 9] * 9
    report('flat', flip(flat, [[[0.5, 0.5, 0.125]] * 9] * 9, ppd))
    report('black-white', flip([[[0, 0, 0]] * 9] * 9, [[[1, 1, 1]] * 9] * 9, ppd))
    report('blue-green', flip([[[0, 0, 1]] * 9] * 9, [[[0, 1, 0]] * 9] * 9, ppd))
    a, b = picture(15, 12, 3, 10), picture(15, 12, 4, 10)
    print('exposures', ' '.join(f'{e:.6f}' for e in exposures(b)))
    report('hdr', hdr_flip(a, b, 40))
    report('display', flip(reinhard(a), reinhard(b), 40))
    a, b = picture(15, 11, 5, 3), picture(15, 11, 6, 3)
    print('exposures', ' '.join(f'{e:.6f}' for e in exposures(b)))
    report('hdr odd', hdr_flip(a, b, 40))
