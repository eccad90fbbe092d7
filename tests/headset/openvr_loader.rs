//! The test runtime itself, through OpenVR's own loader: a small client in a process of its own, with the validation layer.

use std::env;
use std::ffi::{CStr, c_char, c_void};
use std::process::Command;
use std::sync::Mutex;

use ash::vk::{self, Handle as _};
use headset_runtime::script::{Event, Script, Waypoint};
use pbr_vr::asset::picture::Picture;

use crate::common::Workshop;
use crate::common::headset::Headset;

const SIZE: u32 = 32;
/// The layout that the client leaves its images in.
const LAYOUT_VARIABLE: &str = "PBR_VR_TEST_LAYOUT";

static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a structure with strings.
    let text = unsafe { (*data).message_as_c_str() }.map_or(String::new(), |t| t.to_string_lossy().into_owned());
    // Said of lavapipe 22.3 once per instance.
    if !text.contains("conformant") {
        MESSAGES.lock().expect("messages").push(text);
    }
    vk::FALSE
}

/// A Vulkan device with the validation layer and one image per eye.
struct Client {
    _entry: ash::Entry,
    instance: ash::Instance,
    debug: ash::ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    images: [(vk::Image, vk::DeviceMemory); 2],
}

impl Client {
    fn new(system: &openvr::System) -> Self {
        let names = |names: &[&CStr]| names.iter().map(|n| n.as_ptr()).collect::<Vec<*const c_char>>();
        let extensions = names(&[ash::ext::debug_utils::NAME]);
        let layers = names(&[c"VK_LAYER_KHRONOS_validation"]);
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_extension_names(&extensions)
            .enabled_layer_names(&layers)
            .push_next(&mut features);
        // SAFETY: all structures live through their calls; family 0 of every driver here is a graphics family.
        unsafe {
            let entry = ash::Entry::load().expect("a loader");
            let instance = entry.create_instance(&info, None).expect("an instance");
            let debug = ash::ext::debug_utils::Instance::new(&entry, &instance);
            let messenger = debug.create_debug_utils_messenger(&messenger_info(), None).expect("a messenger");
            let physical = system.vulkan_output_device(instance.handle().as_raw() as *mut _).expect("a device");
            let physical = vk::PhysicalDevice::from_raw(physical as u64);
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
            let device = instance.create_device(physical, &info, None).expect("a device");
            let queue = device.get_device_queue(0, 0);
            let pool = device.create_command_pool(&vk::CommandPoolCreateInfo::default(), None).expect("a pool");
            let images = [(); 2].map(|()| image(&device));
            Self { _entry: entry, instance, debug, messenger, physical, device, queue, pool, images }
        }
    }

    /// Clears an eye's image to a colour and leaves it in a layout.
    fn draw(&self, eye: usize, color: [f32; 4], layout: vk::ImageLayout) {
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let barrier = |from, to, write, read| {
            vk::ImageMemoryBarrier::default()
                .image(self.images[eye].0)
                .old_layout(from)
                .new_layout(to)
                .src_access_mask(write)
                .dst_access_mask(read)
                .subresource_range(range)
        };
        let (old, target) = (vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let (none, write) = (vk::AccessFlags::empty(), vk::AccessFlags::TRANSFER_WRITE);
        let (transfer, flags) = (vk::PipelineStageFlags::TRANSFER, vk::DependencyFlags::empty());
        let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the image is this client's own, and the queue is idle before and after.
        unsafe {
            let commands = self.device.allocate_command_buffers(&info).expect("commands");
            let c = commands[0];
            self.device.begin_command_buffer(c, &vk::CommandBufferBeginInfo::default()).expect("recording");
            let before = [barrier(old, target, none, write)];
            self.device.cmd_pipeline_barrier(c, transfer, transfer, flags, &[], &[], &before);
            let value = vk::ClearColorValue { float32: color };
            self.device.cmd_clear_color_image(c, self.images[eye].0, target, &value, &[range]);
            let after = [barrier(target, layout, write, vk::AccessFlags::TRANSFER_READ)];
            self.device.cmd_pipeline_barrier(c, transfer, transfer, flags, &[], &[], &after);
            self.device.end_command_buffer(c).expect("recording");
            let submit = vk::SubmitInfo::default().command_buffers(&commands);
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null()).expect("the queue");
            self.device.queue_wait_idle(self.queue).expect("the queue");
            self.device.free_command_buffers(self.pool, &commands);
        }
    }

    fn texture(&self, eye: usize) -> openvr::compositor::Texture {
        use openvr::compositor::texture::{ColorSpace, Handle, vulkan};
        let texture = vulkan::Texture {
            image: self.images[eye].0.as_raw(),
            device: self.device.handle().as_raw() as *mut _,
            physical_device: self.physical.as_raw() as *mut _,
            instance: self.instance.handle().as_raw() as *mut _,
            queue: self.queue.as_raw() as *mut _,
            queue_family_index: 0,
            width: SIZE,
            height: SIZE,
            format: vk::Format::R8G8B8A8_UNORM.as_raw().cast_unsigned(),
            sample_count: 1,
        };
        openvr::compositor::Texture { handle: Handle::Vulkan(texture), color_space: ColorSpace::Auto }
    }

    fn destroy(self) {
        // SAFETY: the queue is idle, and the runtime has been shut down.
        unsafe {
            for (image, memory) in self.images {
                self.device.destroy_image(image, None);
                self.device.free_memory(memory, None);
            }
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.debug.destroy_debug_utils_messenger(self.messenger, None);
            self.instance.destroy_instance(None);
        }
    }
}

fn messenger_info() -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::ERROR | Severity::WARNING)
        .message_type(Type::GENERAL | Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
}

fn image(device: &ash::Device) -> (vk::Image, vk::DeviceMemory) {
    use vk::ImageUsageFlags as Usage;
    let info = vk::ImageCreateInfo::default()
        .image_type(vk::ImageType::TYPE_2D)
        .format(vk::Format::R8G8B8A8_UNORM)
        .extent(vk::Extent3D { width: SIZE, height: SIZE, depth: 1 })
        .mip_levels(1)
        .array_layers(1)
        .samples(vk::SampleCountFlags::TYPE_1)
        .usage(Usage::TRANSFER_SRC | Usage::TRANSFER_DST | Usage::SAMPLED);
    // SAFETY: the device lives; some memory type fits every image.
    unsafe {
        let image = device.create_image(&info, None).expect("an image");
        let needs = device.get_image_memory_requirements(image);
        let kind = needs.memory_type_bits.trailing_zeros();
        let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
        let memory = device.allocate_memory(&info, None).expect("memory");
        device.bind_image_memory(image, memory, 0).expect("memory");
        (image, memory)
    }
}

/// The client's whole life: it shows a left eye in red and a right one in blue until the runtime asks it to quit.
#[test]
#[ignore = "the other tests start it in a process of its own"]
fn client() {
    let layout = vk::ImageLayout::from_raw(env::var(LAYOUT_VARIABLE).expect("a layout").parse().expect("a number"));
    // SAFETY: the context is shut down before Vulkan.
    let context = unsafe { openvr::init(openvr::ApplicationType::Scene) }.expect("a runtime");
    let system = context.system().expect("a system");
    let compositor = context.compositor().expect("a compositor");
    assert_eq!(system.recommended_render_target_size(), (SIZE, SIZE));
    assert!(compositor.vulkan_instance_extensions_required().is_empty());
    let client = Client::new(&system);
    let mut quit = false;
    while !quit {
        let poses = compositor.wait_get_poses().expect("poses");
        let head = poses.render[0];
        assert!(head.pose_is_valid() && head.device_is_connected());
        println!("height {}", head.device_to_absolute_tracking()[1][3]);
        for (eye, which) in [openvr::Eye::Left, openvr::Eye::Right].into_iter().enumerate() {
            let color = [1.0 - eye as f32, 0.0, eye as f32, 1.0];
            client.draw(eye, color, layout);
            // SAFETY: the image lives until the end, and no other thread uses the queue.
            unsafe { compositor.submit(which, &client.texture(eye), None, None) }.expect("an accepted image");
        }
        compositor.post_present_handoff();
        while let Some(event) = system.poll_next_event() {
            quit |= matches!(event.event, openvr::system::Event::Quit(_));
        }
    }
    system.acknowledge_quit_exiting();
    // SAFETY: nothing of OpenVR's is used any more.
    unsafe { context.shutdown() };
    client.destroy();
    for message in MESSAGES.lock().expect("messages").iter() {
        println!("validation: {message}");
    }
}

/// Runs the client with its images in a layout; what it said.
fn run(headset: &Headset, layout: vk::ImageLayout) -> String {
    let output = Command::new(env::current_exe().expect("this test"))
        .args(["openvr_loader::client", "--exact", "--ignored", "--nocapture"])
        .envs(headset.environment())
        .env(LAYOUT_VARIABLE, layout.as_raw().to_string())
        .output()
        .expect("the client");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

fn script() -> Script {
    let head = |frame, height| Waypoint { frame, position: [0.0, height, 0.0], rotation_degrees: [0.0; 3] };
    Script {
        size: [SIZE; 2],
        show: vec![1, 3],
        head: vec![head(1, 1.0), head(3, 2.0)],
        event: vec![Event { frame: 3, number: 700, device: 0 }],
        ..Script::default()
    }
}

#[test]
fn a_client_gets_poses_shows_pictures_and_leaves_when_told() {
    let workshop = Workshop::new();
    let headset = Headset::install(workshop.folder.path(), &script());
    let said = run(&headset, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    for line in ["height 1\n", "height 1.5\n", "height 2\n"] {
        assert!(said.contains(line), "no {line} in {said}");
    }
    assert!(!said.contains("validation: "), "{said}");
    for (eye, color) in [("left", [1.0, 0.0, 0.0]), ("right", [0.0, 0.0, 1.0])] {
        for frame in [1, 3] {
            let picture = Picture::read(&headset.picture(frame, eye)).expect("a picture");
            assert_eq!([picture.width, picture.height], [SIZE; 2]);
            assert!(picture.pixels.iter().all(|p| p[..3] == color), "frame {frame}, {eye}: {:?}", picture.pixels[0]);
        }
        assert!(!headset.picture(2, eye).exists());
    }
    let calls = headset.calls();
    let names: Vec<&str> = calls.iter().map(|c| c["call"].as_str().expect("a name")).collect();
    let frame = ["WaitGetPoses", "Frame", "Submit", "Submit", "PostPresentHandoff"];
    let start = names.iter().position(|n| *n == frame[0]).expect("a frame");
    assert_eq!(names[start..start + 5], frame);
    let end = ["PollNextEvent", "AcknowledgeQuit_Exiting", "Cleanup", "CleanupDone"];
    assert_eq!(names[names.len() - 4..], end);
    assert_eq!(headset.calls_of("CleanupDone")[0]["copied"], 6);
}

#[test]
fn an_image_in_the_wrong_layout_is_caught_by_the_validation_layer_and_by_nothing_else() {
    let workshop = Workshop::new();
    let headset = Headset::install(workshop.folder.path(), &script());
    let said = run(&headset, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
    assert!(said.contains("validation: ") && said.contains("SHADER_READ_ONLY_OPTIMAL"), "{said}");
    assert!(headset.calls_of("Submit").iter().all(|call| call["code"] == 0));
}
