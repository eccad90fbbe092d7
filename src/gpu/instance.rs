//! The Vulkan instance: loader, layers, extensions, and the validation layer's messages.

use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk::Handle as _;
use ash::{ext, vk};
use raw_window_handle::RawDisplayHandle;

use crate::{Error, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Known harmless validation messages: part of the message's id and text, and the reason.
const EXPECTED: &[(&str, &str)] = &[(
    // Sent once per instance by the layer itself when a driver is not conformant.
    "WARNING-CreateInstance-status-message",
    "lavapipe 22.3 reports itself as a non-conformant driver",
)];

/// The id of messages of Vulkan's loader, which tells of what is installed, and of the cause of an error that the program gets
/// anyway. They are no message of the validation layer.
const LOADER: &str = "Loader Message";

thread_local! {
    /// Whether this thread is inside [`foreign_call`].
    static IS_FOREIGN: Cell<bool> = const { Cell::new(false) };
}

/// Makes a call into a library that calls Vulkan itself, on the program's device or its own: messages of the validation
/// layer that this thread causes meanwhile are the library's, and are counted apart.
pub fn foreign_call<R>(call: impl FnOnce() -> R) -> R {
    let before = IS_FOREIGN.replace(true);
    let result = call();
    IS_FOREIGN.set(before);
    result
}

/// The unexpected messages of the validation layer.
#[derive(Default)]
pub struct Messages {
    ours: Mutex<Vec<String>>,
    /// The number of those inside of [`foreign_call`].
    foreign: AtomicU64,
}

impl Messages {
    fn push(&self, message: String) {
        self.ours.lock().unwrap_or_else(PoisonError::into_inner).push(message);
    }

    /// All that this program's own calls caused, oldest first.
    pub fn all(&self) -> Vec<String> {
        self.ours.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The number of those that calls of a library caused; see [`foreign_call`]. They are no failure.
    pub fn foreign(&self) -> u64 {
        self.foreign.load(Ordering::Relaxed)
    }

    /// An error if there was any.
    pub fn check(&self) -> Result<()> {
        let all = self.all();
        match all.first() {
            None => Ok(()),
            Some(first) => Err(Error::Validation { count: all.len(), first: first.clone() }),
        }
    }
}

/// The loader, the instance and its debug messenger.
pub struct Instance {
    pub(super) entry: ash::Entry,
    pub(super) raw: ash::Instance,
    pub(super) has_debug_utils: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Arc<Messages>,
}

impl Instance {
    /// Loads Vulkan and creates an instance that can present to `display`, if there is one, with the extensions that a
    /// headset's runtime requests.
    ///
    /// # Errors
    /// No Vulkan; a requested extension that is not supported; `validate` without the validation layer.
    pub fn new(validate: bool, display: Option<RawDisplayHandle>, requested: &[CString]) -> Result<Self> {
        // SAFETY: loading the system's Vulkan loader runs only its own initialisers.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::NoVulkan {
            problem: format!("the Vulkan loader does not load ({e})"),
            remedy: "install a graphics driver with Vulkan, or Mesa's software one (Debian: mesa-vulkan-drivers libvulkan1)",
        })?;
        let supported = extensions(&entry);
        check_extensions(requested, &supported)?;
        let has_debug_utils = supported.iter().any(|name| name.as_c_str() == ext::debug_utils::NAME);
        let mut extensions: Vec<*const c_char> = requested.iter().map(|name| name.as_ptr()).collect();
        if let Some(display) = display {
            let wanted = ash_window::enumerate_required_extensions(display)
                .map_err(|e| Error::Window { problem: format!("Vulkan cannot present to this display ({e})") })?;
            extensions.extend(wanted);
        }
        if has_debug_utils {
            extensions.push(ext::debug_utils::NAME.as_ptr());
        }
        drop_repeated(&mut extensions);
        let mut layers: Vec<*const c_char> = Vec::new();
        if validate {
            if !has_layer(&entry, VALIDATION_LAYER) || !has_debug_utils {
                return Err(Error::NoVulkan {
                    problem: "the validation layer is not installed".into(),
                    remedy: "install it (Debian: vulkan-validationlayers; else the Vulkan SDK) or leave out --validate",
                });
            }
            layers.push(VALIDATION_LAYER.as_ptr());
        }
        let messages = Arc::new(Messages::default());
        let mut messenger_info = messenger_info(&messages);
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let application = vk::ApplicationInfo::default().application_name(c"pbr-vr").api_version(vk::API_VERSION_1_3);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_extension_names(&extensions)
            .enabled_layer_names(&layers);
        if validate {
            info = info.push_next(&mut features).push_next(&mut messenger_info);
        }
        // SAFETY: `info` and all it points to live until the call returns; names are NUL-terminated.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| Error::NoVulkan {
            problem: format!("no instance can be created ({result})"),
            remedy: "install a Vulkan 1.3 driver (Debian, without a GPU: mesa-vulkan-drivers)",
        })?;
        let mut instance = Self { entry, raw, has_debug_utils, messenger: None, messages };
        if validate {
            instance.listen()?;
        }
        Ok(instance)
    }

    /// The VkInstance, for a headset's runtime.
    pub fn handle(&self) -> u64 {
        self.raw.handle().as_raw()
    }

    /// The validation layer's messages so far.
    pub fn messages(&self) -> &Arc<Messages> {
        &self.messages
    }

    fn listen(&mut self) -> Result<()> {
        let debug = ext::debug_utils::Instance::new(&self.entry, &self.raw);
        // SAFETY: the user pointer in the info is kept alive by `self.messages`, which outlives the messenger (see Drop).
        let messenger = unsafe { debug.create_debug_utils_messenger(&messenger_info(&self.messages), None) }
            .map_err(Error::vulkan("listening to the validation layer"))?;
        self.messenger = Some((debug, messenger));
        Ok(())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the device and all its objects are gone (Gpu drops its instance last); `messages` still lives.
        unsafe {
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

fn messenger_info(messages: &Arc<Messages>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::ERROR | Severity::WARNING)
        .message_type(Type::GENERAL | Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(messages).cast::<c_void>().cast_mut())
}

unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid callback structure, and `user` is the `Messages` that the instance keeps alive.
    let (data, messages) = unsafe { (&*data, &*user.cast::<Messages>()) };
    // SAFETY: both strings are NUL-terminated or null, by the extension's specification.
    let (id, text) = unsafe { (data.message_id_name_as_c_str(), data.message_as_c_str()) };
    let id = id.unwrap_or(c"?").to_string_lossy();
    let text = text.unwrap_or(c"?").to_string_lossy();
    if id == LOADER {
        tracing::info!("Vulkan's loader: {text}");
        return vk::FALSE;
    }
    let message = format!("{id}: {text}");
    if EXPECTED.iter().any(|(part, _)| message.contains(part)) {
        return vk::FALSE;
    }
    if IS_FOREIGN.get() {
        // A library that is wrong once a frame is told of once.
        if messages.foreign.fetch_add(1, Ordering::Relaxed) == 0 {
            tracing::warn!("validation of the headset runtime's own calls, no failure of this program: {message}");
        }
        return vk::FALSE;
    }
    tracing::error!("validation: {message}");
    messages.push(message);
    vk::FALSE
}

fn extensions(entry: &ash::Entry) -> Vec<CString> {
    // SAFETY: no layer name is given; the call only reads.
    names(&unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default())
}

/// The names in a list of extensions.
pub(super) fn names(all: &[vk::ExtensionProperties]) -> Vec<CString> {
    all.iter().filter_map(|e| e.extension_name_as_c_str().ok().map(CStr::to_owned)).collect()
}

/// Splits the requested extensions into the supported and the missing ones.
pub(super) fn split(requested: &[CString], supported: &[CString]) -> (Vec<CString>, Vec<CString>) {
    requested.iter().cloned().partition(|name| supported.contains(name))
}

/// Names in one line, for messages.
pub(super) fn listed(names: &[CString]) -> String {
    names.iter().map(|name| name.to_string_lossy()).collect::<Vec<_>>().join(", ")
}

/// An error if a headset's runtime requests an extension that the loader and the drivers lack.
fn check_extensions(requested: &[CString], supported: &[CString]) -> Result<()> {
    let (_, missing) = split(requested, supported);
    if missing.is_empty() {
        return Ok(());
    }
    let missing = listed(&missing);
    Err(Error::Headset {
        problem: format!(
            "its runtime needs the Vulkan instance extension(s) {missing}, which this GPU's driver lacks; update the driver"
        ),
    })
}

/// Drops repeated names: Vulkan takes each only once.
pub(super) fn drop_repeated(names: &mut Vec<*const c_char>) {
    let mut seen = std::collections::HashSet::new();
    // SAFETY: the callers' names are NUL-terminated and outlive the list.
    names.retain(|name| seen.insert(unsafe { CStr::from_ptr(*name) }.to_owned()));
}

fn has_layer(entry: &ash::Entry, name: &CStr) -> bool {
    // SAFETY: the call only reads.
    let all = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    all.iter().any(|l| l.layer_name_as_c_str() == Ok(name))
}

/// Whether the validation layer is installed.
pub fn validation_available() -> bool {
    // SAFETY: as in `Instance::new`.
    unsafe { ash::Entry::load() }.is_ok_and(|entry| has_layer(&entry, VALIDATION_LAYER))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requested_extensions_are_split_into_supported_and_missing() {
        let names = |all: &[&CStr]| all.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let there = names(&[c"VK_A", c"VK_B", c"VK_C"]);
        let (have, missing) = split(&names(&[c"VK_C", c"VK_X", c"VK_A", c"VK_Y"]), &there);
        assert_eq!(have, names(&[c"VK_C", c"VK_A"]));
        assert_eq!(listed(&missing), "VK_X, VK_Y");
        assert!(check_extensions(&names(&[c"VK_B"]), &there).is_ok());
        assert!(check_extensions(&missing, &there).is_err_and(|e| e.to_string().contains("VK_X, VK_Y")));
    }
}
