/* A Vulkan host, as small as one can be. */
#include "vk.h"

#include <stdio.h>
#include <stdlib.h>

void vk_check(VkResult result, const char *call)
{
    if (result < 0) {
        fprintf(stderr, "%s: VkResult %d\n", call, result);
        exit(1);
    }
}

static bool find_family(Host *host, VkPhysicalDevice physical)
{
    VkQueueFamilyProperties families[16];
    uint32_t count = 16;
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families);
    VkQueueFlags needed = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    for (uint32_t i = 0; i < count; i++)
        if ((families[i].queueFlags & needed) == needed) {
            host->physical = physical;
            host->family = i;
            return true;
        }
    return false;
}

Host host_open(const char *const *extensions, uint32_t extension_count, VkPhysicalDeviceFeatures2 *features)
{
    Host host = {0};
    VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_3};
    VkInstanceCreateInfo instance = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    VK(vkCreateInstance(&instance, NULL, &host.instance));

    VkPhysicalDevice devices[8];
    uint32_t count = 8;
    VK(vkEnumeratePhysicalDevices(host.instance, &count, devices));
    for (uint32_t i = 0; i < count && !host.physical; i++)
        find_family(&host, devices[i]);
    if (!host.physical) {
        fprintf(stderr, "no device draws and computes\n");
        exit(1);
    }

    float priority = 1.0f;
    VkDeviceQueueCreateInfo queue = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = host.family,
        .queueCount = 1,
        .pQueuePriorities = &priority,
    };
    VkDeviceCreateInfo device = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .pNext = features,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue,
        .enabledExtensionCount = extension_count,
        .ppEnabledExtensionNames = extensions,
    };
    VK(vkCreateDevice(host.physical, &device, NULL, &host.device));
    vkGetDeviceQueue(host.device, host.family, 0, &host.queue);
    VkCommandPoolCreateInfo pool = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, .queueFamilyIndex = host.family};
    VK(vkCreateCommandPool(host.device, &pool, NULL, &host.pool));
    return host;
}

void host_close(Host *host)
{
    vkDestroyCommandPool(host->device, host->pool, NULL);
    vkDestroyDevice(host->device, NULL);
    vkDestroyInstance(host->instance, NULL);
}

VkCommandBuffer host_begin(const Host *host)
{
    VkCommandBufferAllocateInfo one = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = host->pool,
        .commandBufferCount = 1,
    };
    VkCommandBuffer commands;
    VK(vkAllocateCommandBuffers(host->device, &one, &commands));
    VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    VK(vkBeginCommandBuffer(commands, &begin));
    return commands;
}

void host_submit_and_wait(const Host *host, VkCommandBuffer commands)
{
    VK(vkEndCommandBuffer(commands));
    VkSubmitInfo submit = {.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &commands};
    VK(vkQueueSubmit(host->queue, 1, &submit, VK_NULL_HANDLE));
    VK(vkQueueWaitIdle(host->queue));
    vkFreeCommandBuffers(host->device, host->pool, 1, &commands);
}

static VkDeviceMemory allocate(const Host *host, VkMemoryRequirements needs, VkMemoryPropertyFlags wanted)
{
    VkPhysicalDeviceMemoryProperties types;
    vkGetPhysicalDeviceMemoryProperties(host->physical, &types);
    for (uint32_t i = 0; i < types.memoryTypeCount; i++)
        if ((needs.memoryTypeBits >> i & 1) && (types.memoryTypes[i].propertyFlags & wanted) == wanted) {
            VkMemoryAllocateInfo info = {
                .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
                .allocationSize = needs.size,
                .memoryTypeIndex = i,
            };
            VkDeviceMemory memory;
            VK(vkAllocateMemory(host->device, &info, NULL, &memory));
            return memory;
        }
    fprintf(stderr, "no memory of this kind\n");
    exit(1);
}

HostImage host_image(const Host *host, uint32_t width, uint32_t height, uint32_t layers)
{
    HostImage image = {.width = width, .height = height, .layers = layers};
    VkImageCreateInfo create = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO,
        .imageType = VK_IMAGE_TYPE_2D,
        .format = VK_FORMAT_R8G8B8A8_UNORM,
        .extent = {width, height, 1},
        .mipLevels = 1,
        .arrayLayers = layers,
        .samples = VK_SAMPLE_COUNT_1_BIT,
        .usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT,
    };
    VK(vkCreateImage(host->device, &create, NULL, &image.image));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(host->device, image.image, &needs);
    image.memory = allocate(host, needs, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    VK(vkBindImageMemory(host->device, image.image, image.memory, 0));

    VkBufferCreateInfo create_buffer = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
        .size = (VkDeviceSize)4 * width * height * layers,
        .usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT,
    };
    VK(vkCreateBuffer(host->device, &create_buffer, NULL, &image.buffer));
    vkGetBufferMemoryRequirements(host->device, image.buffer, &needs);
    image.buffer_memory =
        allocate(host, needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    VK(vkBindBufferMemory(host->device, image.buffer, image.buffer_memory, 0));
    void *texels;
    VK(vkMapMemory(host->device, image.buffer_memory, 0, VK_WHOLE_SIZE, 0, &texels));
    image.texels = texels;
    return image;
}

void host_image_copy(const HostImage *image, VkCommandBuffer commands)
{
    VkBufferImageCopy region = {
        .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, image->layers},
        .imageExtent = {image->width, image->height, 1},
    };
    VkImageLayout layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    vkCmdCopyImageToBuffer(commands, image->image, layout, image->buffer, 1, &region);
    VkMemoryBarrier to_host = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
        .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
        .dstAccessMask = VK_ACCESS_HOST_READ_BIT,
    };
    vkCmdPipelineBarrier(
        commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &to_host, 0, NULL, 0, NULL);
}

void host_image_free(const Host *host, HostImage *image)
{
    vkDestroyImage(host->device, image->image, NULL);
    vkFreeMemory(host->device, image->memory, NULL);
    vkDestroyBuffer(host->device, image->buffer, NULL);
    vkFreeMemory(host->device, image->buffer_memory, NULL);
}
