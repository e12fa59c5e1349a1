/* What a host has anyway: a Vulkan device, images and a command buffer. Nothing here knows cao, but for what it asks of a device. */
#ifndef VK_H
#define VK_H

#include <stdbool.h>
#include <stdint.h>
#include <vulkan/vulkan.h>

/* Ends the program where a call of Vulkan fails. */
#define VK(call) vk_check((call), #call)

typedef struct Host {
    VkInstance instance;
    VkPhysicalDevice physical;
    uint32_t family;
    VkDevice device;
    VkQueue queue;
    VkCommandPool pool;
} Host;

/* A colour image of RGBA in eight bits with layers, and a buffer to see what it holds. */
typedef struct HostImage {
    uint32_t width, height, layers;
    VkImage image;
    VkDeviceMemory memory;
    VkBuffer buffer;
    VkDeviceMemory buffer_memory;
    const uint8_t *texels;
} HostImage;

void vk_check(VkResult result, const char *call);
/* With these extensions and features; so many names. */
Host host_open(const char *const *extensions, uint32_t extension_count, VkPhysicalDeviceFeatures2 *features);
void host_close(Host *host);
VkCommandBuffer host_begin(const Host *host);
void host_submit_and_wait(const Host *host, VkCommandBuffer commands);
HostImage host_image(const Host *host, uint32_t width, uint32_t height, uint32_t layers);
/* Has the commands copy it to where `texels` is, from the layout for that. */
void host_image_copy(const HostImage *image, VkCommandBuffer commands);
void host_image_free(const Host *host, HostImage *image);

#endif
