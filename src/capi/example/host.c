/* A host in C: lends its device, loads a volume from memory, moves a clip, draws both eyes into its own image and checks every pixel
 * against the lengths of rays in a block of even matter. vk.c is what a host has anyway. */
#include "vk.h"

#include <cao.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { N = 12, SIZE = 32, EYES = 2 };
/* Per mm of the block, and where the eyes are. */
static const double OPACITY = 0.2;
static const float DISTANCE = 40.0f, APART = 2.0f, TANGENT = 0.25f;

/* Ends the program where a call of cao fails. */
#define CAO(call) cao_check((call), #call)
static void cao_check(CaoResult result, const char *call)
{
    if (result != CAO_RESULT_OK) {
        fprintf(stderr, "%s: %d: %s\n", call, (int)result, cao_last_error());
        exit(1);
    }
}

static Host open_host(void)
{
    const char *const *extensions;
    uint32_t count;
    CAO(cao_required_extensions(&extensions, &count));
    VkPhysicalDeviceVulkan13Features v13 = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
    VkPhysicalDeviceFeatures2 features = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &v13};
    CAO(cao_require_features(&features));
    return host_open(extensions, count, &features);
}

static CaoDevice lend(const Host *host)
{
    CaoDeviceInfo info = {
        .size = sizeof info,
        .queue_family = host->family,
        .instance = host->instance,
        .physical_device = host->physical,
        .device = host->device,
        .queue = host->queue,
        .get_instance_proc_addr = vkGetInstanceProcAddr,
    };
    CaoDevice device;
    CAO(cao_device_adopt(&info, &device));
    return device;
}

/* A block of even matter, N mm along each edge. */
static CaoVolume block(void)
{
    static uint16_t voxels[N * N * N];
    for (int i = 0; i < N * N * N; i++)
        voxels[i] = 1000;
    CaoVolumeInfo info = {
        .size = sizeof info,
        .voxel = CAO_VOXEL_U16,
        .dims = {N, N, N},
        .spacing_mm = {1.0, 1.0, 1.0},
        .data = voxels,
        .bytes = sizeof voxels,
    };
    CaoVolume volume;
    CAO(cao_volume_from_memory(&info, &volume));
    return volume;
}

static CaoRenderer renderer_of(CaoDevice device, CaoVolume volume)
{
    CaoSetup setup = {.size = sizeof setup, .method = CAO_METHOD_RAYS, .radius_mm = 4.0f};
    CaoRendererInfo info = {
        .size = sizeof info,
        .colour_format = VK_FORMAT_R8G8B8A8_UNORM,
        .device = device,
        .volume = volume,
        .setup = &setup,
    };
    CaoRenderer renderer;
    CAO(cao_renderer_create(&info, &renderer));
    float opacity[] = {0.0f, 0.0f, 1000.0f, (float)OPACITY};
    float white[] = {0.0f, 1.0f, 1.0f, 1.0f};
    CaoTransfer transfer = {
        .size = sizeof transfer,
        .reference_mm = 1.0f,
        .opacity = opacity,
        .opacity_count = 2,
        .colour = white,
        .colour_count = 1,
    };
    CAO(cao_renderer_set_transfer(renderer, &transfer));
    return renderer;
}

static CaoImage lend_image(CaoDevice device, const HostImage *image)
{
    CaoImageInfo info = {
        .size = sizeof info,
        .format = VK_FORMAT_R8G8B8A8_UNORM,
        .device = device,
        .image = image->image,
        .width = image->width,
        .height = image->height,
        .layers = image->layers,
        .uses = CAO_IMAGE_USE_ATTACHMENT,
        .before = {.stages = VK_PIPELINE_STAGE_2_COPY_BIT, .queue_family = VK_QUEUE_FAMILY_IGNORED},
        .after = {
            .layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
            .stages = VK_PIPELINE_STAGE_2_COPY_BIT,
            .access = VK_ACCESS_2_TRANSFER_READ_BIT,
            .queue_family = VK_QUEUE_FAMILY_IGNORED,
        },
    };
    CaoImage lent;
    CAO(cao_image_adopt(&info, &lent));
    return lent;
}

/* A frame: whatever changed, and both eyes. */
static void frame(const Host *host, CaoDevice device, CaoRenderer renderer, const HostImage *image, CaoImage lent, uint32_t shading)
{
    CaoView views[EYES];
    CaoTarget targets[EYES];
    for (uint32_t eye = 0; eye < EYES; eye++) {
        views[eye] = (CaoView){
            .size = sizeof views[eye],
            .position_mm = {((float)eye - 0.5f) * APART, 0.0f, DISTANCE},
            .orientation = {0.0f, 0.0f, 0.0f, 1.0f},
            .tan_left = -TANGENT,
            .tan_right = TANGENT,
            .tan_up = TANGENT,
            .tan_down = -TANGENT,
            .near_mm = 1.0f,
            .far_mm = INFINITY,
        };
        targets[eye] = (CaoTarget){.size = sizeof targets[eye], .colour = {.image = lent, .layer = eye}};
    }
    CaoLook look = {.size = sizeof look};
    CAO(cao_look_default(&look));
    look.shading = shading;
    look.gain = 1.0f;
    CaoDraw draw = {
        .size = sizeof draw,
        .view_count = EYES,
        .views = views,
        .targets = targets,
        .look = &look,
        .width = SIZE,
        .height = SIZE,
    };

    VkCommandBuffer commands = host_begin(host);
    CaoRecording recording;
    CAO(cao_recording_begin(device, commands, &recording));
    CAO(cao_recording_update(recording, renderer));
    CAO(cao_recording_acquire(recording, lent));
    CAO(cao_recording_draw(recording, renderer, &draw));
    CAO(cao_recording_release(recording, lent));
    CAO(cao_recording_end(recording));
    host_image_copy(image, commands);
    host_submit_and_wait(host, commands);
    double ms;
    CAO(cao_recording_time(recording, &ms));
    CAO(cao_recording_free(recording));
}

/* A box of the block that is left, or cut out. */
typedef struct Box {
    double low[3], high[3];
} Box;

/* The part of a ray, in mm from the eye along z, within a box grown by so much; none where it is 0. */
static double within(const Box *box, double grow, const double eye[3], const double along[3])
{
    double from = 0.0, to = 1e9;
    for (int a = 0; a < 3; a++) {
        double low = box->low[a] - grow - eye[a], high = box->high[a] + grow - eye[a];
        double t0 = low / along[a], t1 = high / along[a];
        if (along[a] == 0.0) {
            if (low > 0.0 || high < 0.0)
                return 0.0;
            continue;
        }
        from = fmax(from, fmin(t0, t1));
        to = fmin(to, fmax(t0, t1));
    }
    return fmax(to - from, 0.0);
}

/* Every pixel's opacity is that of its ray's way through what is visible; near edges, where it falls to 0 over a voxel, only between the
 * ways of one that is smaller and of one that is larger. */
static int check(const HostImage *image, const char *what, Box visible)
{
    int clear = 0, full = 0, wrong = 0;
    for (int eye = 0; eye < EYES; eye++)
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                double position[3] = {((double)eye - 0.5) * APART, 0.0, DISTANCE};
                double along[3] = {
                    TANGENT * (2.0 * (x + 0.5) / SIZE - 1.0), TANGENT * (1.0 - 2.0 * (y + 0.5) / SIZE), -1.0};
                double length = sqrt(along[0] * along[0] + along[1] * along[1] + 1.0);
                double least = within(&visible, -1.0, position, along) * length;
                double most = within(&visible, 1.0, position, along) * length;
                double found = image->texels[4 * ((eye * SIZE + y) * SIZE + x) + 3] / 255.0;
                double slack = 1.5 / 255.0;
                if (found < 1.0 - pow(1.0 - OPACITY, least) - slack || found > 1.0 - pow(1.0 - OPACITY, most) + slack)
                    wrong++;
                clear += most == 0.0;
                full += least > 0.5;
            }
    printf("%-28s %4d pixels clear, %4d in the block, %d wrong\n", what, clear, full, wrong);
    return wrong == 0 && clear > 100 && full > 100 ? 0 : 1;
}

/* The sum of its red. */
static double light(const HostImage *image)
{
    double sum = 0.0;
    for (int i = 0; i < EYES * SIZE * SIZE; i++)
        sum += image->texels[4 * i];
    return sum;
}

/* A beam along z, four mm wide, as twelve triangles. */
static CaoMesh beam(void)
{
    float vertices[24];
    for (int i = 0; i < 8; i++) {
        vertices[3 * i] = i & 1 ? 2.0f : -2.0f;
        vertices[3 * i + 1] = i & 2 ? 20.0f : -20.0f;
        vertices[3 * i + 2] = i & 4 ? 20.0f : -20.0f;
    }
    uint32_t indices[] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    CaoMesh mesh;
    CAO(cao_mesh_from_memory(vertices, 8, indices, 36, &mesh));
    return mesh;
}

/* The left half of the block as labels 300, the right half 7. */
static CaoVolume halves(void)
{
    static uint16_t labels[N * N * N];
    for (int i = 0; i < N * N * N; i++)
        labels[i] = i % N < N / 2 ? 300 : 7;
    CaoVolumeInfo info = {
        .size = sizeof info,
        .voxel = CAO_VOXEL_U16,
        .dims = {N, N, N},
        .spacing_mm = {1.0, 1.0, 1.0},
        .data = labels,
        .bytes = sizeof labels,
    };
    CaoVolume volume;
    CAO(cao_volume_from_memory(&info, &volume));
    return volume;
}

int main(void)
{
    if (cao_abi() != CAO_ABI) {
        fprintf(stderr, "the library is of another version than cao.h\n");
        return 1;
    }
    Host host = open_host();
    HostImage image = host_image(&host, SIZE, SIZE, EYES);
    CaoDevice device = lend(&host);
    CaoVolume volume = block();
    CaoRenderer renderer = renderer_of(device, volume);
    CAO(cao_volume_free(volume));
    CaoImage lent = lend_image(device, &image);

    int failed = 0;
    const double half = N / 2.0;
    Box all = {{-half, -half, -half}, {half, half, half}};
    frame(&host, device, renderer, &image, lent, CAO_SHADING_NONE);
    failed += check(&image, "the whole block", all);
    double bright = light(&image);
    frame(&host, device, renderer, &image, lent, CAO_SHADING_AO);
    double dim = light(&image);
    printf("%-28s %.0f %% of the light\n", "with ambient occlusion", 100.0 * dim / bright);
    failed += !(dim < 0.95 * bright && dim > 0.1 * bright);

    /* From above, the eyes' side, all of the light reaches what they see; the first harmonic alone is the same from everywhere. */
    CaoAmbientLight sky = {.size = sizeof sky, .kind = CAO_LIGHT_KIND_SKY, .up = {0.0, 0.0, 2.0}};
    CAO(cao_renderer_set_ambient_light(renderer, &sky));
    frame(&host, device, renderer, &image, lent, CAO_SHADING_AO);
    double above = light(&image);
    double one[3] = {1.0, 1.0, 1.0};
    CaoAmbientLight even = {
        .size = sizeof even, .kind = CAO_LIGHT_KIND_HARMONICS, .coefficients = one, .coefficient_count = 1};
    CAO(cao_renderer_set_ambient_light(renderer, &even));
    frame(&host, device, renderer, &image, lent, CAO_SHADING_AO);
    double same = light(&image);
    printf("%-28s %.0f %% from above, %.0f %% of a harmonic\n", "of this light", 100.0 * above / dim, 100.0 * same / dim);
    failed += !(above > 1.03 * dim && fabs(same - dim) < 0.01 * dim);
    CAO(cao_renderer_set_ambient_light(renderer, NULL));

    /* Features by labels, of which one is hidden, by another method; then one by values that is blue. */
    const char *options[] = {"combine=max"};
    CaoSetup by_features = {
        .size = sizeof by_features, .method = CAO_METHOD_FEATURE_DRIVEN, .radius_mm = 4.0f, .options = options, .option_count = 1};
    CAO(cao_renderer_set_setup(renderer, &by_features));
    uint32_t left_label = 300, right_label = 7;
    CaoFeature features[2] = {
        {.size = sizeof features[0], .visible = 0, .opacity = 1.0f, .label_count = 1, .labels = &left_label},
        {.size = sizeof features[1], .visible = 1, .opacity = 1.0f, .label_count = 1, .labels = &right_label},
    };
    CaoVolume labels = halves();
    CAO(cao_renderer_set_features(renderer, features, 2, labels));
    CAO(cao_volume_free(labels));
    frame(&host, device, renderer, &image, lent, CAO_SHADING_NONE);
    Box right = all;
    right.low[0] = 0.0;
    failed += check(&image, "with a hidden feature", right);
    CaoFeature blue = {
        .size = sizeof blue, .visible = 1, .opacity = 1.0f, .has_colour = 1, .colour = {0.0f, 0.0f, 1.0f}, .values = {500.0f, 2000.0f}};
    CAO(cao_renderer_set_features(renderer, &blue, 1, (CaoVolume){0}));
    frame(&host, device, renderer, &image, lent, CAO_SHADING_NONE);
    failed += check(&image, "a blue feature", all) + (light(&image) != 0.0);
    CAO(cao_renderer_set_features(renderer, NULL, 0, (CaoVolume){0}));

    /* The half-space z > 0 of a clip, turned so that it is x > 0, removes what is to the right of it. */
    for (int step = 0; step < 3; step++) {
        double x = 3.0 - 2.0 * step;
        CaoClip clip = {
            .size = sizeof clip,
            .shape = CAO_SHAPE_PLANE,
            .side = CAO_SIDE_REMOVE,
            .translate_mm = {(float)x, 0.0f, 0.0f},
            .rotate_deg = {0.0f, 90.0f, 0.0f},
            .scale = {1.0f, 1.0f, 1.0f},
        };
        CAO(cao_renderer_set_clips(renderer, &clip, 1));
        frame(&host, device, renderer, &image, lent, CAO_SHADING_NONE);
        Box left = all;
        left.high[0] = x;
        char what[32];
        snprintf(what, sizeof what, "cut at x = %g mm", x);
        failed += check(&image, what, left);
    }

    CaoMesh mesh = beam();
    CaoClip clip = {.size = sizeof clip, .shape = CAO_SHAPE_MESH, .side = CAO_SIDE_KEEP, .scale = {1.0f, 1.0f, 1.0f}, .mesh = mesh};
    CAO(cao_renderer_set_clips(renderer, &clip, 1));
    CAO(cao_mesh_free(mesh));
    frame(&host, device, renderer, &image, lent, CAO_SHADING_NONE);
    Box slab = all;
    slab.low[0] = -2.0;
    slab.high[0] = 2.0;
    failed += check(&image, "what a mesh keeps", slab);

    CAO(cao_image_free(lent));
    CAO(cao_renderer_free(renderer));
    CAO(cao_device_free(device));
    host_image_free(&host, &image);
    host_close(&host);
    printf("%s\n", failed ? "FAILED" : "all as it should be");
    return failed != 0;
}
