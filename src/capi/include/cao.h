/* The C interface of cao: volumes with ambient occlusion, drawn into a host's Vulkan images. MIT.
 * Made of src/capi by `tools/capi header`; edit there. How a host uses it: docs/embedding/c.md.
 *
 * Pointers   are NULL, which is refused where it is not said to be allowed, or point to as much as is said, until the function
 *            returns; nothing keeps them. Vulkan's handles are valid, belong together and outlive what was made with them.
 * Structs    begin with their size: set it to sizeof. Another size is refused.
 * Enums      are uint32_t in structs; a number that is none of them is refused.
 * Handles    are numbers in structs, one type a kind, 0 for none. Any number may be given: one that was freed, never was or is of another
 *            kind is refused. They live in a table of the process.
 * Errors     are the result; cao_last_error has the words, of each thread. On an error nothing is done, unless it says so.
 * Threads    any function, any thread. Two threads at once in calls with one renderer or one recording: the second is refused with
 *            CAO_RESULT_BUSY. During a call that uses the lent queue nobody else may use it. A host's command buffer, and the pool that
 *            it is of, belong to one thread at a time, as Vulkan has it.
 * Never      prints, exits, or handles a signal. Of the system's it uses memory, and Vulkan through the host's loader.
 */

#ifndef CAO_H
#define CAO_H

#include <stdint.h>
#include <vulkan/vulkan_core.h>

// Changes where functions or structs change so that a host must be compiled again.
#define CAO_ABI 2

// What a function answers. Where it is not CAO_RESULT_OK nothing was done, what it would have given is 0, and cao_last_error says why.
enum CaoResult
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    CAO_RESULT_OK = 0,
    // A pointer is NULL that must not be.
    CAO_RESULT_NULL_POINTER = 1,
    // A handle that this library never gave out, or of something else.
    CAO_RESULT_BAD_HANDLE = 2,
    // A handle of what was freed.
    CAO_RESULT_FREED = 3,
    // Another thread is in a call with the same renderer or recording. Try again.
    CAO_RESULT_BUSY = 4,
    // It is needed still: a device by what is on it, an image by recordings, anything by a call of another thread. Free those first.
    CAO_RESULT_IN_USE = 5,
    // Not now: a recording that has ended, or not, or failed; an ambient volume that is out of date; an image that is not acquired.
    CAO_RESULT_WRONG_ORDER = 6,
    // A struct's size is none that this library knows, or a number of bytes is not what the format asks for.
    CAO_RESULT_WRONG_SIZE = 7,
    // A value that cannot be: a number beyond an enum, dimensions of 0, a scale below 0, a mesh with a hole.
    CAO_RESULT_BAD_VALUE = 8,
    // Beyond a limit of the device or of the library.
    CAO_RESULT_LIMIT = 9,
    // The device lacks something, or was made without it.
    CAO_RESULT_DEVICE = 10,
    // A call of Vulkan failed, perhaps because the device is lost.
    CAO_RESULT_VULKAN = 11,
    // Memory of the processor or of the device could not be had.
    CAO_RESULT_OUT_OF_MEMORY = 12,
    // The device has not finished yet.
    CAO_RESULT_NOT_READY = 13,
    // A fault of this library, caught at its edge. What the call worked on is to be freed.
    CAO_RESULT_INTERNAL = 14,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoResult CaoResult;
#else
typedef int32_t CaoResult;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Types of voxels.
enum CaoVoxel
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Unsigned, 8 bits.
    CAO_VOXEL_U8 = 0,
    // Unsigned, 16 bits.
    CAO_VOXEL_U16 = 1,
    // Signed, 16 bits.
    CAO_VOXEL_I16 = 2,
    // IEEE 754, 32 bits.
    CAO_VOXEL_F32 = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoVoxel CaoVoxel;
#else
typedef uint32_t CaoVoxel;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Ways to compute ambient occlusion (docs/method.md).
enum CaoMethod
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Rays by brick; what to take where no other is the point.
    CAO_METHOD_RAYS = 0,
    // Contextual ambient occlusion, as in the paper.
    CAO_METHOD_CAO = 1,
    // Local ambient occlusion: every voxel at every change.
    CAO_METHOD_LAO = 2,
    // The mean opacity of a box around each voxel.
    CAO_METHOD_SAT = 3,
    // Shells of such boxes. Option shells.
    CAO_METHOD_SHELLS = 4,
    // Vicinity shading.
    CAO_METHOD_VICINITY = 5,
    // Clustered local histograms; does not see clips. Options clusters, bleeding.
    CAO_METHOD_HISTOGRAMS = 6,
    // Feature-driven: each feature is occluded by its own matter alone. Option combine.
    CAO_METHOD_FEATURE_DRIVEN = 7,
    // Smooth probabilistic ambient occlusion. Options levels, normal.
    CAO_METHOD_SPAO = 8,
    // Cone tracing.
    CAO_METHOD_CONES = 9,
    // Deep volumetric ambient occlusion, by the network that is shipped: every update runs it whole.
    CAO_METHOD_DEEP = 10,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoMethod CaoMethod;
#else
typedef uint32_t CaoMethod;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Shapes of clips, of size 1 about the volume's centre until their pose moves them.
enum CaoShape
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The half-space z > 0.
    CAO_SHAPE_PLANE = 0,
    // The cube |x|, |y|, |z| < 1.
    CAO_SHAPE_BOX = 1,
    // The ball of radius 1.
    CAO_SHAPE_SPHERE = 2,
    // Axis z, radius 1, |z| < 1.
    CAO_SHAPE_CYLINDER = 3,
    // Axis z, apex at z = 1, base of radius 1 at z = -1.
    CAO_SHAPE_CONE = 4,
    // Ring of radius 1 in the xy plane, tube of radius 0.4.
    CAO_SHAPE_TORUS = 5,
    // CaoClip.mesh.
    CAO_SHAPE_MESH = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoShape CaoShape;
#else
typedef uint32_t CaoShape;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Which side of a shape disappears.
enum CaoSide
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The inside.
    CAO_SIDE_REMOVE = 0,
    // The outside.
    CAO_SIDE_KEEP = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoSide CaoSide;
#else
typedef uint32_t CaoSide;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Where ambient light comes from.
enum CaoLightKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The same from everywhere; the default.
    CAO_LIGHT_KIND_UNIFORM = 0,
    // As a sky's: the cosine to a direction.
    CAO_LIGHT_KIND_SKY = 1,
    // Spherical harmonics.
    CAO_LIGHT_KIND_HARMONICS = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoLightKind CaoLightKind;
#else
typedef uint32_t CaoLightKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What an image is used for here; the sum of those that it is.
enum CaoImageUse
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Its depth ends rays: CaoTarget.scene. Of VK_IMAGE_USAGE_SAMPLED_BIT.
    CAO_IMAGE_USE_SAMPLED = 1,
    // Drawn to: CaoTarget.colour and depth. Of VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT, or that of depth.
    CAO_IMAGE_USE_ATTACHMENT = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoImageUse CaoImageUse;
#else
typedef uint32_t CaoImageUse;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Which parts of the light are shown.
enum CaoShading
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // The transfer function's colours alone.
    CAO_SHADING_NONE = 0,
    // Ambient, diffuse and specular light.
    CAO_SHADING_PHONG = 1,
    // Colours times the ambient factor.
    CAO_SHADING_AO = 2,
    // Light and the ambient factor; the default.
    CAO_SHADING_PHONG_AO = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoShading CaoShading;
#else
typedef uint32_t CaoShading;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What views are laid over.
enum CaoOver
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Nothing: they replace what is there.
    CAO_OVER_NOTHING = 0,
    // What is there: colour + (1 - alpha) · there.
    CAO_OVER_SCENE = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoOver CaoOver;
#else
typedef uint32_t CaoOver;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What numbers of colours mean whose format does not say it.
enum CaoCoding
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Light, linear.
    CAO_CODING_LINEAR = 0,
    // Coded by sRGB's curve.
    CAO_CODING_SRGB = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum CaoCoding CaoCoding;
#else
typedef uint32_t CaoCoding;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a host lends. All of it stays the host's and must outlive the CaoDevice.
typedef struct {
    // sizeof(CaoDeviceInfo).
    uint32_t size;
    // Family of the queue that will run the recordings; it does graphics and compute.
    uint32_t queue_family;
    // Of Vulkan 1.3 or newer; of 1.1 or 1.2 with VK_KHR_synchronization2 and VK_KHR_dynamic_rendering, and what they need, on the device.
    VkInstance instance;
    // The one that the device was made of.
    VkPhysicalDevice physical_device;
    // Made with cao_required_extensions and cao_require_features.
    VkDevice device;
    // A queue of that family for the functions that say they use one, during which nobody else may. NULL: those refuse.
    VkQueue queue;
    // The host's loader: vkGetInstanceProcAddr.
    PFN_vkGetInstanceProcAddr get_instance_proc_addr;
} CaoDeviceInfo;

// A device that a host lent. 0 is none.
typedef struct {
    // Without meaning for a host.
    uint64_t id;
} CaoDevice;

// How it looks. cao_look_default fills it.
typedef struct {
    // sizeof(CaoLook).
    uint32_t size;
    // A CaoShading.
    uint32_t shading;
    // Light from everywhere, 0.4.
    float ambient;
    // Light that depends on the surface's direction, 0.65.
    float diffuse;
    // Reflected light, 0.15,
    float specular;
    // and its exponent, 24.
    float shininess;
    // Direction towards the light, from the first eye.
    float light[3];
    // The ambient factor is shown times this, 2.
    float gain;
    // Distance between samples in mm; 0: a quarter of the smallest spacing.
    float step_mm;
    // Rays a pixel, 1.
    uint32_t samples;
    // Whether surfaces are lit from behind as from the front: 0 or 1.
    uint32_t two_sided;
} CaoLook;

// Hears of every failure, on the thread of the call that fails, before it returns. It may call this library; failures in there are not
// told again. Nothing may be thrown out of it.
typedef void (*CaoErrorCallback)(CaoResult result, const char *message, void *user);

// A volume on a device. 0 is none.
typedef struct {
    // Without meaning for a host.
    uint64_t id;
} CaoRenderer;

// A part of a volume. Features are called by their numbers, "1" the first.
typedef struct {
    // sizeof(CaoFeature).
    uint32_t size;
    // Whether it shows: 0 or 1.
    uint32_t visible;
    // What its opacities are multiplied with, 0 … 16; they end at 1.
    float opacity;
    // Whether clips leave it whole: 0 or 1.
    uint32_t spared;
    // Whether it has a colour of its own, 0 or 1; else it has the transfer function's.
    uint32_t has_colour;
    // Red, green, blue; linear, 0 … 1.
    float colour[3];
    // Without labels: its voxels' values are from the first number on and below the second. Intervals lie apart.
    float values[2];
    // With labels: how many it has,
    uint32_t label_count;
    // 0.
    uint32_t reserved;
    // and which; each belongs to one feature.
    const uint32_t *labels;
} CaoFeature;

// A volume in memory, on no device. 0 is none.
typedef struct {
    // Without meaning for a host.
    uint64_t id;
} CaoVolume;

// Ambient light by the direction that it comes from, along the volume's axes (docs/method.md, 2.1).
typedef struct {
    // sizeof(CaoAmbientLight).
    uint32_t size;
    // A CaoLightKind.
    uint32_t kind;
    // Of a sky: the direction that is up, of any length.
    double up[3];
    // Of harmonics: three doubles each, red, green and blue, in the order 1, y, z, x, xy, yz, 3z² - 1, xz, x² - y².
    const double *coefficients;
    // Of harmonics: how many, 1 … 9; the others are 0.
    uint32_t coefficient_count;
    // 0.
    uint32_t reserved;
} CaoAmbientLight;

// One side of a barrier: how a host leaves an image, or wants it.
typedef struct {
    // Stages that touched it last, or touch it next.
    VkPipelineStageFlags2 stages;
    // How.
    VkAccessFlags2 access;
    // Before, VK_IMAGE_LAYOUT_UNDEFINED gives up what it holds.
    VkImageLayout layout;
    // The family that owns it there, if another than the recordings'; else VK_QUEUE_FAMILY_IGNORED.
    uint32_t queue_family;
} CaoImageState;

// An image of a host: flat, of one sample and one level.
typedef struct {
    // sizeof(CaoImageInfo).
    uint32_t size;
    // As it was made: R8G8B8A8 or B8G8R8A8 in UNORM or SRGB, A2B10G10R10_UNORM_PACK32, R16G16B16A16_SFLOAT, R32G32B32A32_SFLOAT,
    // D16_UNORM, D24_UNORM_S8_UINT, D32_SFLOAT.
    VkFormat format;
    // On this device.
    CaoDevice device;
    // It must outlive the CaoImage.
    VkImage image;
    // Pixels.
    uint32_t width;
    // Pixels.
    uint32_t height;
    // One a view, or one that views share.
    uint32_t layers;
    // Of CaoImageUse.
    uint32_t uses;
    // How recordings find it.
    CaoImageState before;
    // How they leave it.
    CaoImageState after;
} CaoImageInfo;

// An image that a host lent. 0 is none.
typedef struct {
    // Without meaning for a host.
    uint64_t id;
} CaoImage;

// Commands in a host's command buffer. 0 is none.
typedef struct {
    // Without meaning for a host.
    uint64_t id;
} CaoRecording;

// An eye, as OpenXR gives it, in mm in the volume's frame.
typedef struct {
    // sizeof(CaoView).
    uint32_t size;
    // 1: depth is 1 at near_mm and 0 at far_mm; 0: the other way round.
    uint32_t reversed;
    // The eye.
    float position_mm[3];
    // x, y, z, w of a unit quaternion, from the eye's frame to the volume's; eyes look along -z, y is up.
    float orientation[4];
    // Tangents of the angles to the left edge, usually negative,
    float tan_left;
    // the right one,
    float tan_right;
    // the upper one,
    float tan_up;
    // and the lower one, usually negative.
    float tan_down;
    // Nothing nearer is drawn.
    float near_mm;
    // Nothing farther is drawn; may be infinite.
    float far_mm;
} CaoView;

// A rectangle of a layer.
typedef struct {
    // An image that is acquired; 0 for none.
    CaoImage image;
    // Its layer.
    uint32_t layer;
    // The left column,
    uint32_t x;
    // the upper row.
    uint32_t y;
    // 0.
    uint32_t reserved;
} CaoPlace;

// Where a view goes.
typedef struct {
    // sizeof(CaoTarget).
    uint32_t size;
    // 0.
    uint32_t reserved;
    // Colours, premultiplied.
    CaoPlace colour;
    // Depth where opacity passes a half; or none.
    CaoPlace depth;
    // Depth of what the host drew, at which rays end; or none, for all views.
    CaoPlace scene;
} CaoTarget;

// A drawing.
typedef struct {
    // sizeof(CaoDraw).
    uint32_t size;
    // 1 … 4.
    uint32_t view_count;
    // As many; the first is the left eye.
    const CaoView *views;
    // As many.
    const CaoTarget *targets;
    // NULL is the default.
    const CaoLook *look;
    // Pixels of every view.
    uint32_t width;
    // Pixels of every view.
    uint32_t height;
    // A CaoOver.
    uint32_t over;
    // A CaoCoding.
    uint32_t coding;
} CaoDraw;

// How occlusion is computed. All but the size 0 is the default.
typedef struct {
    // sizeof(CaoSetup).
    uint32_t size;
    // A CaoMethod.
    uint32_t method;
    // How far occlusion reaches in mm; 0: 20 voxels of the smallest spacing.
    float radius_mm;
    // Directions a voxel: of rays and of feature-driven an even number up to 254, of CAO's and LAO's 6, 14, 26, 50 or 54, of vicinity's 26, 50
    // or 96, of cones 14 or 26, and 0 of those that follow none; 0: the method's own.
    uint32_t directions;
    // Options of the method, each as NAME=VALUE, as in `combine=max`; NULL where there are none.
    const char *const *options;
    // As many.
    uint32_t option_count;
    // 0.
    uint32_t reserved;
} CaoSetup;

// What a renderer is made of.
typedef struct {
    // sizeof(CaoRendererInfo).
    uint32_t size;
    // Format of the colours that it will draw to; others are possible, and cost a pipeline when they first come.
    VkFormat colour_format;
    // On this device.
    CaoDevice device;
    // Copied to the device; afterwards it may be freed.
    CaoVolume volume;
    // Name of a transfer function: auto, ct-bone, ct-soft, mr, paper. NULL is auto.
    const char *preset;
    // NULL is the default.
    const CaoSetup *setup;
} CaoRendererInfo;

// A transfer function of the host's own: linear between points, whose values ascend.
typedef struct {
    // sizeof(CaoTransfer).
    uint32_t size;
    // Length in mm that opacities are for; 0: the smallest spacing.
    float reference_mm;
    // Two floats a point: value, opacity.
    const float *opacity;
    // Four floats a point: value, red, green, blue; linear.
    const float *colour;
    // Points of opacity, at most 64.
    uint32_t opacity_count;
    // Points of colour, at most 64.
    uint32_t colour_count;
} CaoTransfer;

// A mesh to clip with. 0 is none.
typedef struct {
    // Without meaning for a host.
    uint64_t id;
} CaoMesh;

// A clip: p_world = T + Rz·Ry·Rx·(S·p_shape), in mm from the volume's centre, along its axes.
typedef struct {
    // sizeof(CaoClip).
    uint32_t size;
    // A CaoShape.
    uint32_t shape;
    // A CaoSide.
    uint32_t side;
    // T.
    float translate_mm[3];
    // Degrees about the fixed axes x, then y, then z.
    float rotate_deg[3];
    // S, each above 0.
    float scale[3];
    // Of CAO_SHAPE_MESH; else ignored.
    CaoMesh mesh;
} CaoClip;

// Voxels and where they are.
typedef struct {
    // sizeof(CaoVolumeInfo).
    uint32_t size;
    // A CaoVoxel.
    uint32_t voxel;
    // Voxels along x, y, z.
    uint32_t dims[3];
    // 0.
    uint32_t reserved;
    // Distance of their centres along x, y, z in mm.
    double spacing_mm[3];
    // The values, x fastest, in the machine's byte order; at any address.
    const void *data;
    // Bytes there: the product of dims and of a voxel's bytes.
    uint64_t bytes;
} CaoVolumeInfo;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The CAO_ABI that the library was built with; compare it with the header's.
uint32_t cao_abi(void);

// The library's version, as "0.1.0". Alive as long as the library.
const char *cao_version(void);

// The device extensions that a host must enable: an array for VkDeviceCreateInfo, alive as long as the library.
CaoResult cao_required_extensions(const char *const **names, uint32_t *count);

// Sets what this library needs to VK_TRUE in the features that a host is about to make its device with, and leaves the rest. The chain
// must hold a VkPhysicalDeviceVulkan13Features, or the structs of synchronization2 and dynamicRendering. Whether the physical device has them is the host's to ask, or cao_device_adopt's.
CaoResult cao_require_features(VkPhysicalDeviceFeatures2 *features);

// Lends a device. Nothing of the host's is ever destroyed. Free it with cao_device_free when all that is on it is freed, and before the
// host destroys what it lent.
CaoResult cao_device_adopt(const CaoDeviceInfo *info,
                           CaoDevice *device);

// Gives a device back: from here on nothing of the host's is used. Refused while anything is on it.
CaoResult cao_device_free(CaoDevice device);

// Fills in the default look. Set its size before.
CaoResult cao_look_default(CaoLook *look);

// Why this thread's last call that failed did so, in UTF-8; empty before any. Alive until this thread's next call that fails; copy it.
const char *cao_last_error(void);

// Has every failure of any thread told, or with NULL none. A thread that is failing may still call the former one for a moment.
// `user` is handed to it as it is; any thread may have it.
CaoResult cao_set_error_callback(CaoErrorCallback callback, void *user);

// Changes the features, all of them, at most 8; 0 and NULL for none. Voxels belong to them by their values where `labels` is 0, else by a
// volume of CAO_VOXEL_U8 or CAO_VOXEL_U16 on the renderer's grid, which may be freed afterwards; those with no feature's label are of
// none. How features are shown never uses a queue; other voxels use the lent queue and wait for it.
CaoResult cao_renderer_set_features(CaoRenderer renderer,
                                    const CaoFeature *features,
                                    uint32_t feature_count,
                                    CaoVolume labels);

// Changes the ambient light; NULL is uniform. Of CAO_METHOD_RAYS all, of CAO_METHOD_CAO and CAO_METHOD_LAO light of one colour; other
// methods have uniform light only. Uses the lent queue where light becomes coloured or ceases to be.
CaoResult cao_renderer_set_ambient_light(CaoRenderer renderer,
                                         const CaoAmbientLight *light);

// Lends an image, for as many recordings as wanted, between cao_recording_acquire and cao_recording_release. Free it with cao_image_free
// before the host destroys it.
CaoResult cao_image_adopt(const CaoImageInfo *info,
                          CaoImage *image);

// Gives an image back. Refused while a recording that acquired it is not freed.
CaoResult cao_image_free(CaoImage image);

// Begins to record into a command buffer of the host, which is recording, outside of rendering, for a queue of the device's family. The
// host adds its own commands before and after, ends it and submits it once. Free it with cao_recording_free.
CaoResult cao_recording_begin(CaoDevice device,
                              VkCommandBuffer commands,
                              CaoRecording *recording);

// Takes an image over, in the state that CaoImageInfo.before says.
CaoResult cao_recording_acquire(CaoRecording recording, CaoImage image);

// Gives an image back, in the state that CaoImageInfo.after says.
CaoResult cao_recording_release(CaoRecording recording, CaoImage image);

// Records what brings a renderer's ambient volume up to date; nothing where nothing changed. Recordings run in the order in which they
// end, and before any later function with this renderer that uses the queue.
CaoResult cao_recording_update(CaoRecording recording,
                               CaoRenderer renderer);

// Records the drawing of one to four views into images that are acquired. Refused while the ambient volume is out of date.
CaoResult cao_recording_draw(CaoRecording recording, CaoRenderer renderer, const CaoDraw *draw);

// Ends a recording; the command buffer goes on recording what is the host's. Keep the recording until the device has run it.
CaoResult cao_recording_end(CaoRecording recording);

// What the device took for a recording, in ms. CAO_RESULT_NOT_READY until it has run it.
CaoResult cao_recording_time(CaoRecording recording, double *ms);

// Frees a recording that the device has run. One that has not ended, or failed, is given up: the host resets the command buffer without
// submitting it, and renderers that were updated in it compute everything again.
CaoResult cao_recording_free(CaoRecording recording);

// Gives up what an ended recording holds: after commands that the host will never submit, though their recording ended.
CaoResult cao_renderer_invalidate(CaoRenderer renderer);

// Copies a volume to a device and builds what draws it. Uses the lent queue and waits for it. Free it with cao_renderer_free.
CaoResult cao_renderer_create(const CaoRendererInfo *info, CaoRenderer *renderer);

// Frees a renderer. Recordings keep what they need of it.
CaoResult cao_renderer_free(CaoRenderer renderer);

// Changes the transfer function to one of the names of CaoRendererInfo.preset.
CaoResult cao_renderer_set_preset(CaoRenderer renderer, const char *preset);

// Changes the transfer function to points of the host's own.
CaoResult cao_renderer_set_transfer(CaoRenderer renderer, const CaoTransfer *transfer);

// Changes how occlusion is computed; the ambient light stays, and a method that does not follow it is refused. Uses the lent queue where
// the method is another. NULL is the default.
CaoResult cao_renderer_set_setup(CaoRenderer renderer,
                                 const CaoSetup *setup_info);

// Changes the clips, all of them, at most 8; 0 and NULL for none. Never uses a queue: maps of meshes are made by the next update.
CaoResult cao_renderer_set_clips(CaoRenderer renderer, const CaoClip *clips, uint32_t clip_count);

// Overwrites a box of voxels, the first of which is `first`, by a volume of the same type. Uses the lent queue and waits for it.
CaoResult cao_renderer_set_values(CaoRenderer renderer, const uint32_t *first, CaoVolume values);

// Copies a volume from memory. Free it with cao_volume_free; a renderer that was made of it needs it no more.
CaoResult cao_volume_from_memory(const CaoVolumeInfo *info, CaoVolume *volume);

// Frees a volume.
CaoResult cao_volume_free(CaoVolume volume);

// Copies a mesh: three floats a vertex, in mm; three indices a triangle. It must enclose something and have no hole. Free it with
// cao_mesh_free; clips that are set keep it.
CaoResult cao_mesh_from_memory(const float *vertices,
                               uint32_t vertex_count,
                               const uint32_t *indices,
                               uint32_t index_count,
                               CaoMesh *mesh);

// Frees a mesh.
CaoResult cao_mesh_free(CaoMesh mesh);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CAO_H */
