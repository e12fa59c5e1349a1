/* What a host can get wrong, and what it is told: NULL, wrong order, double free, wrong size, zero size, a destroyed device's handle, two
 * threads. Each is an error with words; nothing is done, leaked or undefined, as AddressSanitizer and valgrind see it. */
#include "vk.h"

#include <cao.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 8 };
static atomic_int told;
static int expected, wrong;

static void hear(CaoResult result, const char *message, void *user)
{
    atomic_int *count = user;
    /* The library may be called from here; its failures are not told again. */
    if (result == CAO_RESULT_OK || !message[0] || cao_volume_free((CaoVolume){0}) != CAO_RESULT_BAD_HANDLE)
        wrong++;
    atomic_fetch_add(count, 1);
}

/* A call that is refused, for this reason. */
#define REFUSED(reason, call) refused((reason), (call), #call)
static void refused(CaoResult reason, CaoResult result, const char *call)
{
    expected++;
    if (result == reason && result != CAO_RESULT_OK && cao_last_error()[0])
        return;
    printf("%s: %d (%s), expected %d\n", call, (int)result, result ? cao_last_error() : "", (int)reason);
    wrong++;
}

#define FINE(call) fine((call), #call)
static void fine(CaoResult result, const char *call)
{
    if (result == CAO_RESULT_OK)
        return;
    printf("%s: %d: %s\n", call, (int)result, cao_last_error());
    wrong++;
}

static uint8_t voxels[SIZE * SIZE * SIZE];

static CaoVolumeInfo volume_info(void)
{
    return (CaoVolumeInfo){
        .size = sizeof(CaoVolumeInfo),
        .voxel = CAO_VOXEL_U8,
        .dims = {SIZE, SIZE, SIZE},
        .spacing_mm = {1.0, 1.0, 1.0},
        .data = voxels,
        .bytes = sizeof voxels,
    };
}

static CaoVolume a_volume(void)
{
    CaoVolumeInfo info = volume_info();
    CaoVolume volume = {0};
    FINE(cao_volume_from_memory(&info, &volume));
    return volume;
}

/* Without any device. */
static void data(void)
{
    CaoVolume volume = {7};
    CaoVolumeInfo info = volume_info();
    REFUSED(CAO_RESULT_NULL_POINTER, cao_volume_from_memory(NULL, &volume));
    wrong += volume.id != 0;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_volume_from_memory(&info, NULL));
    uint32_t sizes[] = {0, 1, sizeof info - 1, sizeof info + 8, UINT32_MAX};
    for (int i = 0; i < 5; i++) {
        info.size = sizes[i];
        REFUSED(CAO_RESULT_WRONG_SIZE, cao_volume_from_memory(&info, &volume));
    }
    /* Only as much is read as the struct says that it has. */
    uint32_t *tiny = malloc(sizeof *tiny);
    *tiny = sizeof *tiny;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_volume_from_memory((const CaoVolumeInfo *)(void *)tiny, &volume));
    free(tiny);
    for (int a = 0; a < 3; a++) {
        info = volume_info();
        info.dims[a] = 0;
        REFUSED(CAO_RESULT_BAD_VALUE, cao_volume_from_memory(&info, &volume));
        info.dims[a] = UINT32_MAX;
        REFUSED(CAO_RESULT_WRONG_SIZE, cao_volume_from_memory(&info, &volume));
        info = volume_info();
        info.spacing_mm[a] = a ? -1.0 : NAN;
        REFUSED(CAO_RESULT_BAD_VALUE, cao_volume_from_memory(&info, &volume));
    }
    info = volume_info();
    info.dims[0] = info.dims[1] = info.dims[2] = UINT32_MAX;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_volume_from_memory(&info, &volume));
    info = volume_info();
    info.bytes = 0;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_volume_from_memory(&info, &volume));
    info.bytes = sizeof voxels - 1;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_volume_from_memory(&info, &volume));
    info = volume_info();
    info.data = NULL;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_volume_from_memory(&info, &volume));
    info = volume_info();
    info.voxel = 4;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_volume_from_memory(&info, &volume));
    float nan[1] = {NAN};
    info = (CaoVolumeInfo){
        .size = sizeof info, .voxel = CAO_VOXEL_F32, .dims = {1, 1, 1}, .spacing_mm = {1, 1, 1}, .data = nan, .bytes = 4};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_volume_from_memory(&info, &volume));

    /* At an odd address, as data in files lie. */
    uint8_t odd[5] = {0};
    nan[0] = 2.0f;
    memcpy(odd + 1, nan, 4);
    info.data = odd + 1;
    FINE(cao_volume_from_memory(&info, &volume));
    FINE(cao_volume_free(volume));
    REFUSED(CAO_RESULT_FREED, cao_volume_free(volume));
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_volume_free((CaoVolume){0}));
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_volume_free((CaoVolume){1}));
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_volume_free((CaoVolume){UINT64_MAX}));
    /* A number that was not given out yet. */
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_volume_free((CaoVolume){volume.id + 1000}));
    volume = a_volume();
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_mesh_free((CaoMesh){volume.id}));
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_device_free((CaoDevice){volume.id}));
    FINE(cao_volume_free(volume));

    CaoMesh mesh;
    float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, NAN};
    uint32_t faces[] = {0, 2, 1, 0, 1, 4};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_mesh_from_memory(corners, 3, faces, 0, &mesh));
    REFUSED(CAO_RESULT_BAD_VALUE, cao_mesh_from_memory(corners, 3, faces, 3, &mesh));
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_mesh_from_memory(corners, 3, faces, 4, &mesh));
    REFUSED(CAO_RESULT_BAD_VALUE, cao_mesh_from_memory(corners, 3, faces, 6, &mesh));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_mesh_from_memory(NULL, 3, faces, 3, &mesh));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_mesh_from_memory(corners, 3, NULL, 3, &mesh));
    faces[0] = 3;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_mesh_from_memory(corners, 4, faces, 3, &mesh));

    REFUSED(CAO_RESULT_NULL_POINTER, cao_required_extensions(NULL, NULL));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_require_features(NULL));
    VkPhysicalDeviceFeatures2 features = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_require_features(&features));
    features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_require_features(&features));
}

static PFN_vkVoidFunction VKAPI_CALL no_function(VkInstance instance, const char *name)
{
    (void)instance, (void)name;
    return NULL;
}

static CaoDeviceInfo device_info(const Host *host)
{
    return (CaoDeviceInfo){
        .size = sizeof(CaoDeviceInfo),
        .queue_family = host->family,
        .instance = host->instance,
        .physical_device = host->physical,
        .device = host->device,
        .queue = host->queue,
        .get_instance_proc_addr = vkGetInstanceProcAddr,
    };
}

/* A device that was made without what is required. */
static void poor_device(void)
{
    Host host = host_open(NULL, 0, NULL);
    CaoDeviceInfo info = device_info(&host);
    CaoDevice device;
    REFUSED(CAO_RESULT_DEVICE, cao_device_adopt(&info, &device));
    host_close(&host);
}

static void *free_it(void *volume)
{
    CaoResult result = cao_volume_free(*(CaoVolume *)volume);
    return (void *)(intptr_t)result;
}

static void *set_clips(void *renderer)
{
    intptr_t bad = 0;
    for (int i = 0; i < 200; i++) {
        CaoResult result = cao_renderer_set_clips(*(CaoRenderer *)renderer, NULL, 0);
        bad += result != CAO_RESULT_OK && result != CAO_RESULT_BUSY;
        /* Its own words, whatever other threads fail at. */
        cao_mesh_free((CaoMesh){0});
        bad += strstr(cao_last_error(), "mesh: the handle is 0") == NULL;
    }
    return (void *)bad;
}

static void two_threads(CaoRenderer renderer)
{
    cao_set_error_callback(NULL, NULL);
    for (int i = 0; i < 50; i++) {
        CaoVolume volume = a_volume();
        pthread_t other;
        void *its;
        pthread_create(&other, NULL, free_it, &volume);
        intptr_t mine = (intptr_t)free_it(&volume);
        pthread_join(other, &its);
        intptr_t theirs = (intptr_t)its;
        /* One frees it, the other comes too late. */
        wrong += mine + theirs != CAO_RESULT_FREED || (mine && theirs);
    }
    pthread_t other;
    void *theirs;
    pthread_create(&other, NULL, set_clips, &renderer);
    wrong += set_clips(&renderer) != NULL;
    pthread_join(other, &theirs);
    wrong += theirs != NULL;
    cao_set_error_callback(hear, &told);
}

static CaoImageInfo image_info(CaoDevice device, const HostImage *image)
{
    return (CaoImageInfo){
        .size = sizeof(CaoImageInfo),
        .format = VK_FORMAT_R8G8B8A8_UNORM,
        .device = device,
        .image = image->image,
        .width = SIZE,
        .height = SIZE,
        .layers = 1,
        .uses = CAO_IMAGE_USE_ATTACHMENT,
        .before = {.queue_family = VK_QUEUE_FAMILY_IGNORED},
        .after = {
            .layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
            .stages = VK_PIPELINE_STAGE_2_COPY_BIT,
            .access = VK_ACCESS_2_TRANSFER_READ_BIT,
            .queue_family = VK_QUEUE_FAMILY_IGNORED,
        },
    };
}

static void settings(CaoDevice device, CaoVolume volume, CaoRenderer renderer)
{
    CaoRenderer none;
    CaoSetup setup = {.size = sizeof setup, .method = 10};
    CaoRendererInfo info = {
        .size = sizeof info, .colour_format = VK_FORMAT_R8G8B8A8_UNORM, .device = device, .volume = volume, .setup = &setup};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_create(&info, &none));
    setup = (CaoSetup){.size = sizeof setup, .directions = 7};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_create(&info, &none));
    setup = (CaoSetup){.size = 0};
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_renderer_create(&info, &none));
    info.setup = NULL;
    info.preset = "no such thing";
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_create(&info, &none));
    info.preset = "\xff";
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_create(&info, &none));
    info.preset = NULL;
    info.colour_format = VK_FORMAT_R8_UNORM;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_create(&info, &none));
    info.colour_format = VK_FORMAT_R8G8B8A8_UNORM;
    info.volume.id = device.id;
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_renderer_create(&info, &none));
    wrong += none.id != 0;

    setup = (CaoSetup){.size = sizeof setup, .radius_mm = NAN};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_setup(renderer, &setup));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_preset(renderer, NULL));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_transfer(renderer, NULL));
    CaoTransfer transfer = {.size = sizeof transfer, .opacity_count = 1};
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_transfer(renderer, &transfer));
    transfer.opacity_count = 0;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_transfer(renderer, &transfer));

    CaoClip clips[9];
    for (int i = 0; i < 9; i++)
        clips[i] = (CaoClip){.size = sizeof clips[i], .shape = CAO_SHAPE_BOX, .scale = {1, 1, 1}};
    REFUSED(CAO_RESULT_LIMIT, cao_renderer_set_clips(renderer, clips, 9));
    REFUSED(CAO_RESULT_LIMIT, cao_renderer_set_clips(renderer, clips, UINT32_MAX));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_clips(renderer, NULL, 1));
    clips[1].size = 4;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_renderer_set_clips(renderer, clips, 2));
    clips[0].shape = 7;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_clips(renderer, clips, 1));
    clips[0].shape = CAO_SHAPE_MESH;
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_renderer_set_clips(renderer, clips, 1));
    clips[0].shape = CAO_SHAPE_BOX;
    clips[0].side = 2;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_clips(renderer, clips, 1));
    clips[0].side = CAO_SIDE_KEEP;
    clips[0].scale[1] = 0;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_clips(renderer, clips, 1));

    uint32_t first[3] = {1, 0, 0};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_values(renderer, first, volume));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_values(renderer, NULL, volume));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_look_default(NULL));
    CaoLook look = {.size = 3};
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_look_default(&look));
}

static void parts(CaoDevice device, CaoVolume volume, CaoRenderer renderer)
{
    const CaoVolume none = {0};
    CaoFeature two[2] = {
        {.size = sizeof two[0], .visible = 1, .opacity = 1, .values = {0, 10}},
        {.size = sizeof two[1], .visible = 1, .opacity = 1, .values = {10, 20}},
    };
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_features(renderer, NULL, 1, none));
    REFUSED(CAO_RESULT_LIMIT, cao_renderer_set_features(renderer, two, 9, none));
    REFUSED(CAO_RESULT_BAD_HANDLE, cao_renderer_set_features(renderer, two, 2, (CaoVolume){device.id}));
    two[1].size--;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_renderer_set_features(renderer, two, 2, none));
    two[1].size++;
    two[1].values[0] = 9;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_features(renderer, two, 2, none));
    two[1].opacity = NAN;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_features(renderer, two, 2, volume));
    two[1].opacity = 1;
    two[0].label_count = 1;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_features(renderer, two, 2, volume));
    uint32_t label = 65536;
    two[0].labels = &label;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_features(renderer, two, 2, volume));
    label = 3;
    two[1].label_count = 1;
    two[1].labels = &label;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_features(renderer, two, 2, volume));
    /* Of another grid, and of another type. */
    CaoVolumeInfo info = volume_info();
    info.dims[0] = SIZE / 2;
    info.dims[1] = 2 * SIZE;
    CaoVolume labels;
    FINE(cao_volume_from_memory(&info, &labels));
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_features(renderer, two, 1, labels));
    FINE(cao_volume_free(labels));
    REFUSED(CAO_RESULT_FREED, cao_renderer_set_features(renderer, two, 1, labels));
    float *values = calloc(SIZE * SIZE * SIZE, sizeof *values);
    info = volume_info();
    info.voxel = CAO_VOXEL_F32;
    info.data = values;
    info.bytes = SIZE * SIZE * SIZE * sizeof *values;
    FINE(cao_volume_from_memory(&info, &labels));
    free(values);
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_features(renderer, two, 1, labels));
    FINE(cao_volume_free(labels));

    CaoAmbientLight light = {.size = sizeof light, .kind = 3};
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_ambient_light(renderer, &light));
    light.kind = CAO_LIGHT_KIND_SKY;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_ambient_light(renderer, &light));
    light.kind = CAO_LIGHT_KIND_HARMONICS;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_ambient_light(renderer, &light));
    light.coefficient_count = 10;
    REFUSED(CAO_RESULT_LIMIT, cao_renderer_set_ambient_light(renderer, &light));
    light.coefficient_count = 1;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_ambient_light(renderer, &light));
    double dark[3] = {1, 1, -1};
    light.coefficients = dark;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_ambient_light(renderer, &light));
    light.size = 0;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_renderer_set_ambient_light(renderer, &light));

    const char *options[] = {"levels=mip", "levels", "normal=7", "shells=4", NULL};
    CaoSetup setup = {.size = sizeof setup, .method = CAO_METHOD_SPAO, .options = options, .option_count = 2};
    for (int i = 0; i < 3; i++) {
        REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_set_setup(renderer, &setup));
        options[1] = options[2 + i];
    }
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_setup(renderer, &setup));
    setup.option_count = UINT32_MAX;
    REFUSED(CAO_RESULT_LIMIT, cao_renderer_set_setup(renderer, &setup));
    setup.options = NULL;
    setup.option_count = 1;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_renderer_set_setup(renderer, &setup));
}

static void images(CaoDevice device, const HostImage *image)
{
    CaoImage none;
    CaoImageInfo info = image_info(device, image);
    info.image = VK_NULL_HANDLE;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_image_adopt(&info, &none));
    info = image_info(device, image);
    info.width = 0;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_image_adopt(&info, &none));
    info = image_info(device, image);
    info.layers = UINT32_MAX;
    REFUSED(CAO_RESULT_LIMIT, cao_image_adopt(&info, &none));
    info = image_info(device, image);
    info.uses = 0;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_image_adopt(&info, &none));
    info.uses = 4;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_image_adopt(&info, &none));
    info = image_info(device, image);
    info.format = -1;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_image_adopt(&info, &none));
    info = image_info(device, image);
    info.after.layout = VK_IMAGE_LAYOUT_UNDEFINED;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_image_adopt(&info, &none));
}

/* A recording that a refused call ends: nothing of it may run. */
static void given_up(const Host *host, CaoRecording recording, VkCommandBuffer commands)
{
    REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_end(recording));
    FINE(cao_recording_free(recording));
    REFUSED(CAO_RESULT_FREED, cao_recording_end(recording));
    vkFreeCommandBuffers(host->device, host->pool, 1, &commands);
}

static void recordings(const Host *host, CaoDevice device, CaoRenderer renderer, const HostImage *host_image)
{
    CaoImage image;
    CaoImageInfo info = image_info(device, host_image);
    FINE(cao_image_adopt(&info, &image));
    CaoView view = {
        .size = sizeof view,
        .position_mm = {0, 0, 40},
        .orientation = {0, 0, 0, 1},
        .tan_left = -0.2f,
        .tan_right = 0.2f,
        .tan_up = 0.2f,
        .tan_down = -0.2f,
        .near_mm = 1,
        .far_mm = 100,
    };
    CaoTarget target = {.size = sizeof target, .colour = {.image = image}};
    CaoDraw good = {
        .size = sizeof good, .view_count = 1, .views = &view, .targets = &target, .width = SIZE, .height = SIZE};

    CaoRecording recording;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_recording_begin(device, VK_NULL_HANDLE, &recording));

    /* What is wrong with the struct leaves the recording as it was. */
    VkCommandBuffer commands = host_begin(host);
    REFUSED(CAO_RESULT_NULL_POINTER, cao_recording_begin(device, commands, NULL));
    FINE(cao_recording_begin(device, commands, &recording));
    double ms;
    REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_time(recording, &ms));
    REFUSED(CAO_RESULT_IN_USE, cao_device_free(device));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_recording_draw(recording, renderer, NULL));
    CaoDraw draw = good;
    draw.view_count = 0;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_draw(recording, renderer, &draw));
    draw.view_count = 5;
    REFUSED(CAO_RESULT_LIMIT, cao_recording_draw(recording, renderer, &draw));
    draw = good;
    draw.targets = NULL;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_recording_draw(recording, renderer, &draw));
    draw = good;
    draw.over = 2;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_draw(recording, renderer, &draw));
    draw = good;
    draw.size = 0;
    REFUSED(CAO_RESULT_WRONG_SIZE, cao_recording_draw(recording, renderer, &draw));
    /* Before any update. */
    REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_draw(recording, renderer, &good));
    given_up(host, recording, commands);

    /* An image that is not acquired, acquired twice, released too early; a size of 0. */
    for (int what = 0; what < 6; what++) {
        commands = host_begin(host);
        FINE(cao_recording_begin(device, commands, &recording));
        FINE(cao_recording_update(recording, renderer));
        if (what == 0)
            REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_draw(recording, renderer, &good));
        if (what == 1)
            REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_release(recording, image));
        if (what > 1)
            FINE(cao_recording_acquire(recording, image));
        if (what == 2)
            REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_acquire(recording, image));
        draw = good;
        draw.width = what == 3 ? 0 : 2 * SIZE;
        if (what == 3 || what == 4)
            REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_draw(recording, renderer, &draw));
        CaoView behind = view;
        behind.far_mm = 0;
        draw = good;
        draw.views = &behind;
        if (what == 5) {
            REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_draw(recording, renderer, &draw));
            REFUSED(CAO_RESULT_IN_USE, cao_image_free(image));
        }
        given_up(host, recording, commands);
    }

    /* Freed without an end: the renderer knows that its update will not run, and does not draw. */
    commands = host_begin(host);
    FINE(cao_recording_begin(device, commands, &recording));
    FINE(cao_recording_update(recording, renderer));
    FINE(cao_recording_free(recording));
    vkFreeCommandBuffers(host->device, host->pool, 1, &commands);
    commands = host_begin(host);
    FINE(cao_recording_begin(device, commands, &recording));
    FINE(cao_recording_acquire(recording, image));
    REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_draw(recording, renderer, &good));
    given_up(host, recording, commands);

    /* Of two devices. */
    CaoDevice other;
    CaoDeviceInfo lend = device_info(host);
    FINE(cao_device_adopt(&lend, &other));
    commands = host_begin(host);
    FINE(cao_recording_begin(other, commands, &recording));
    REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_update(recording, renderer));
    REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_draw(recording, renderer, &good));
    REFUSED(CAO_RESULT_BAD_VALUE, cao_recording_acquire(recording, image));
    REFUSED(CAO_RESULT_IN_USE, cao_device_free(other));
    given_up(host, recording, commands);
    FINE(cao_device_free(other));

    /* In order; then once more what is over. */
    commands = host_begin(host);
    FINE(cao_recording_begin(device, commands, &recording));
    FINE(cao_recording_update(recording, renderer));
    FINE(cao_recording_acquire(recording, image));
    FINE(cao_recording_draw(recording, renderer, &good));
    FINE(cao_recording_release(recording, image));
    FINE(cao_recording_end(recording));
    REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_end(recording));
    REFUSED(CAO_RESULT_WRONG_ORDER, cao_recording_update(recording, renderer));
    REFUSED(CAO_RESULT_NOT_READY, cao_recording_time(recording, &ms));
    host_submit_and_wait(host, commands);
    FINE(cao_recording_time(recording, &ms));
    REFUSED(CAO_RESULT_NULL_POINTER, cao_recording_time(recording, NULL));
    REFUSED(CAO_RESULT_IN_USE, cao_image_free(image));
    FINE(cao_recording_free(recording));
    REFUSED(CAO_RESULT_FREED, cao_recording_free(recording));
    REFUSED(CAO_RESULT_FREED, cao_recording_time(recording, &ms));
    FINE(cao_image_free(image));
    REFUSED(CAO_RESULT_FREED, cao_image_free(image));
}

static void with_device(void)
{
    const char *const *extensions;
    uint32_t count;
    FINE(cao_required_extensions(&extensions, &count));
    VkPhysicalDeviceVulkan13Features v13 = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES};
    VkPhysicalDeviceFeatures2 features = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &v13};
    features.features.geometryShader = VK_TRUE;
    FINE(cao_require_features(&features));
    wrong += !v13.synchronization2 || !v13.dynamicRendering || !features.features.shaderStorageImageExtendedFormats;
    wrong += !features.features.geometryShader || features.features.robustBufferAccess || v13.maintenance4;
    features.features.geometryShader = VK_FALSE;
    Host host = host_open(extensions, count, &features);

    CaoDevice device;
    CaoDeviceInfo info = device_info(&host);
    info.get_instance_proc_addr = NULL;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_device_adopt(&info, &device));
    info.get_instance_proc_addr = no_function;
    REFUSED(CAO_RESULT_DEVICE, cao_device_adopt(&info, &device));
    info = device_info(&host);
    info.instance = NULL;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_device_adopt(&info, &device));
    info = device_info(&host);
    info.physical_device = NULL;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_device_adopt(&info, &device));
    info = device_info(&host);
    info.device = NULL;
    REFUSED(CAO_RESULT_NULL_POINTER, cao_device_adopt(&info, &device));
    info = device_info(&host);
    info.queue_family = 1000;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_device_adopt(&info, &device));
    info = device_info(&host);
    info.queue = NULL;
    FINE(cao_device_adopt(&info, &device));
    CaoVolume volume = a_volume();
    CaoRendererInfo create = {
        .size = sizeof create, .colour_format = VK_FORMAT_R8G8B8A8_UNORM, .device = device, .volume = volume};
    CaoRenderer renderer;
    REFUSED(CAO_RESULT_BAD_VALUE, cao_renderer_create(&create, &renderer));
    FINE(cao_device_free(device));
    REFUSED(CAO_RESULT_FREED, cao_renderer_create(&create, &renderer));

    info = device_info(&host);
    FINE(cao_device_adopt(&info, &device));
    create.device = device;
    FINE(cao_renderer_create(&create, &renderer));
    HostImage image = host_image(&host, SIZE, SIZE, 1);
    settings(device, volume, renderer);
    parts(device, volume, renderer);
    images(device, &image);
    recordings(&host, device, renderer, &image);
    two_threads(renderer);
    REFUSED(CAO_RESULT_IN_USE, cao_device_free(device));
    FINE(cao_renderer_free(renderer));
    REFUSED(CAO_RESULT_FREED, cao_renderer_free(renderer));
    REFUSED(CAO_RESULT_FREED, cao_renderer_set_clips(renderer, NULL, 0));
    REFUSED(CAO_RESULT_FREED, cao_renderer_invalidate(renderer));
    FINE(cao_device_free(device));

    /* Of a device that is gone. */
    REFUSED(CAO_RESULT_FREED, cao_device_free(device));
    REFUSED(CAO_RESULT_FREED, cao_renderer_create(&create, &renderer));
    CaoImage lent;
    CaoImageInfo lend = image_info(device, &image);
    REFUSED(CAO_RESULT_FREED, cao_image_adopt(&lend, &lent));
    CaoRecording recording;
    VkCommandBuffer commands = host_begin(&host);
    REFUSED(CAO_RESULT_FREED, cao_recording_begin(device, commands, &recording));
    vkFreeCommandBuffers(host.device, host.pool, 1, &commands);
    FINE(cao_volume_free(volume));
    host_image_free(&host, &image);
    host_close(&host);
}

int main(void)
{
    for (int i = 0; i < SIZE * SIZE * SIZE; i++)
        voxels[i] = (uint8_t)(i % 251);
    wrong += cao_last_error()[0] != 0;
    cao_set_error_callback(hear, &told);
    data();
    poor_device();
    with_device();
    if (atomic_load(&told) != expected) {
        printf("the callback heard of %d, expected %d\n", atomic_load(&told), expected);
        wrong++;
    }
    printf("%d calls refused, %d wrong\n", expected, wrong);
    return wrong != 0;
}
