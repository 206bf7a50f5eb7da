//! Rows of the schema, of all editions together (protocol ES-05, ES-09, 12.1): name of the kind, attributes, children.

/// See [`super::Schema::new`].
pub(super) const KINDS: &[(&str, &str, &str)] = &[
    ("EtherCATInfo", "Version", "InfoReference Vendor Descriptions VendorSpecific* Scalings*"),
    ("EtherCATModule", "Version", "InfoReference Vendor Modules VendorSpecific*"),
    ("EtherCATDict", "Version", "Vendor Dictionary VendorSpecific*"),
    (
        "Vendor",
        "FileVersion UniqueName",
        "Id Name Comment URL DescriptionURL Image16x14* ImageFile16x14* ImageData16x14* VendorSpecific*",
    ),
    ("Name", "LcId", ""),
    ("Comment", "LcId", ""),
    ("URL", "LcId", ""),
    ("DisplayName", "LcId", ""),
    ("Text", "LcId", ""),
    ("Descriptions", "", "Groups Devices Modules"),
    ("Groups", "", "Group"),
    ("Group", "SortOrder ParentGroup", "Type Name Comment Image16x14* ImageFile16x14* ImageData16x14* VendorSpecific*"),
    ("Devices", "", "Device"),
    (
        "Device",
        "Physics Invisible Crc32",
        "Sci* Type=DeviceType HideType AlternativeType SubDevice Name Comment URL Info GroupType Profile Fmmu Sm Su \
         RxPdo=Pdo TxPdo=Pdo Mailbox Dc Slots ESC Eeprom Image16x14* ImageFile16x14* ImageData16x14* \
         VendorSpecific* OpMode!",
    ),
    (
        "DeviceType",
        "ProductCode RevisionNo SerialNo CheckProductCode CheckRevisionNo CheckSerialNo UseLrdLwr ModulePdoGroup \
         TcSmClass TcCfgModeSafeOp DownloadModuleList ShowHideableSubDevices",
        "",
    ),
    ("HideType", "ProductCode RevisionNo ProductRevision", ""),
    ("AlternativeType", "ProductCode RevisionNo", ""),
    ("SubDevice", "ProductCode RevisionNo PreviousDevice PreviousPortNo Hideable", ""),
    (
        "Info",
        "",
        "Electrical StateMachine Mailbox=MailboxTimes EtherCATController Port IdentificationReg134 IdentificationAdo \
         StationAliasSupported* DeviceFeature* ExecutionUnit* BackupParameterSupport* ErrorHandlingSupport* \
         VendorSpecific*",
    ),
    ("Electrical", "", "EBusCurrent EtherCATp*"),
    ("StateMachine", "", "Timeout=StateTimes Behavior"),
    ("StateTimes", "", "PreopTimeout SafeopOpTimeout BackToInitTimeout BackToSafeopTimeout"),
    ("Behavior", "StartToInit StartToPreop StartToSafeop StartToSafeopNoSync", ""),
    ("MailboxTimes", "", "Timeout=RequestTimes"),
    ("RequestTimes", "", "RequestTimeout ResponseTimeout"),
    ("EtherCATController", "", "DpramSize SmCount FmmuCount DcSyncCount DcLatchCount"),
    ("Port", "", "Type Connector* Label RxDelay TxDelay PhysicalPhyAddr EtherCATp*"),
    ("Fmmu", "OpOnly Sm Su", ""),
    (
        "Sm",
        "MinSize MaxSize DefaultSize StartAddress ControlByte Enable Virtual OpOnly OneByteMode Watchdog \
         FixedAssignment",
        "",
    ),
    ("Su", "SeparateSu SeparateFrame FrameRepeatSupport DependOnInputState", ""),
    (
        "Pdo",
        "Fixed Mandatory Virtual Sm Su OSFac OSMin OSMax OSIndexInc OverwrittenByModule PdoOrder SRA_Parameter \
         SafetyPdoType SafetyConnNumber",
        "Index Name Exclude=Index Entry ExcludedSm",
    ),
    ("Index", "DependOnSlot DependOnSlotGroup OverwrittenByModule", ""),
    ("Entry", "Fixed SafetyConnNumber", "Index SubIndex BitLen Name Comment DataType"),
    ("DataType", "DScale SwapData", ""),
    ("Mailbox", "DataLinkLayer RealTimeMode", "AoE EoE CoE FoE SoE VoE* VendorSpecific*"),
    ("AoE", "AdsRouter GenerateOwnNetId InitializeOwnNetId", "InitCmd=RawInitCmd"),
    ("EoE", "IP MAC TimeStamp", "InitCmd=RawInitCmd"),
    (
        "CoE",
        "SdoInfo PdoAssign PdoConfig PdoUpload CompleteAccess SegmentedSdo DiagHistory EdsFile DS402Channels \
         SdoUploadWithMaxLength TimeDistribution ModuleOD",
        "Object* InitCmd VendorSpecific*",
    ),
    ("FoE", "", ""),
    ("SoE", "ChannelCount DriveFollowsBit3Support", "InitCmd=SoeInitCmd DiagFile* DiagMessages* VendorSpecific*"),
    ("InitCmd", "CompleteAccess OverwrittenByModule Fixed", "Transition Index SubIndex Data=Adapted Comment"),
    ("Adapted", "AdaptAutomatically", ""),
    ("SoeInitCmd", "Chn Fixed", "Transition IDN Data Comment"),
    ("RawInitCmd", "Fixed", "Transition Type Data Comment"),
    (
        "Dc",
        "UnknownFRMW Unknown64Bit ExternalRefClock PotentialReferenceClock TimeLoopControlOnly PdoOversampling",
        "OpMode VendorSpecific*",
    ),
    (
        "OpMode",
        "",
        "Name=Word Desc AssignActivate ActivateAdditional! CycleTimeSync0=Time ShiftTimeSync0=Time \
         CycleTimeSync1=Time ShiftTimeSync1=Time CycleTimeSync2! ShiftTimeSync2! CycleTimeSync3! \
         ShiftTimeSync3! Sm=ModeSm VendorSpecific*",
    ),
    ("Word", "", ""),
    ("Time", "Factor Input OutputDelayTime! InputDelayTime!", ""),
    ("ModeSm", "No", "SyncType CycleTime=Time ShiftTime=ModeShift Pdo=ModePdo"),
    ("ModeShift", "Factor MinAfterSync MinBeforeFrame", ""),
    ("ModePdo", "OSFac", ""),
    ("ESC", "", "Reg0108 Reg0400 Reg0410 Reg0420 VendorSpecific*"),
    ("Eeprom", "AssignToPdi", "Data ByteSize ConfigData BootStrap Category VendorSpecific*"),
    ("Category", "PreserveOnlineData", "CatNo Data DataString DataUINT DataUDINT"),
    (
        "Profile",
        "Channel",
        "ProfileNo AddInfo SubAddInfo ChannelCount ChannelInfo DictionaryFile Dictionary DiagFile* DiagMessages* \
         VendorSpecific*",
    ),
    ("ChannelInfo", "OverwrittenByModule ChannelGroup", "ProfileNo AddInfo SubAddInfo DisplayName VendorSpecific*"),
    ("Dictionary", "", "UnitTypes* DataTypes Objects VendorSpecific*"),
    ("DataTypes", "", "DataType=TypeOfData"),
    ("TypeOfData", "", "Index Name=Word BaseType Comment BitSize ArrayInfo SubItem EnumInfo Properties* Xml*"),
    ("ArrayInfo", "", "LBound Elements"),
    (
        "SubItem",
        "",
        "SubIdx Name=Word DisplayName Type Comment BitSize BitOffs DefaultString DefaultData MinValue MaxValue \
         DefaultValue Flags Property* Xml*",
    ),
    ("EnumInfo", "", "Text Enum Comment"),
    ("Objects", "", "Object"),
    ("Object", "", "Index Name Comment Type BitSize Info=Values Flags Properties* Xml*"),
    (
        "Values",
        "",
        "DefaultString MinData MaxData DefaultData MinValue MaxValue DefaultValue SubItem=Part DisplayName Unit",
    ),
    ("Part", "", "Name=Word Info=Values"),
    ("Flags", "", "Access Category=Word PdoMapping SafetyMapping Attribute Transition SdoAccess Backup Setting"),
    ("Access", "ReadRestrictions WriteRestrictions", ""),
    (
        "Slots",
        "SlotPdoIncrement SlotIndexIncrement SlotGroupPdoIncrement SlotGroupIndexIncrement MaxSlotCount \
         MaxSlotGroupCount DownloadModuleIdentList DownloadModuleAddressList DownloadModuleListTransition \
         IdentifyModuleBy MdpChannel SlotMdpChannelCount",
        "Slot SlotGroupData ModulePdoGroup SlotSelections* ModuleGroups! VendorSpecific*",
    ),
    (
        "Slot",
        "MinInstances MaxInstances SlotGroup SlotPdoIncrement SlotIndexIncrement SlotGroupPdoIncrement \
         SlotGroupIndexIncrement TreeView Default! Fallback! MdpChannel",
        "Name ModuleIdent ModuleClass Image16x14* ImageFile16x14* ImageData16x14*",
    ),
    ("ModuleIdent", "Default", ""),
    ("ModuleClass", "", "Class VendorId Name Image16x14* ImageFile16x14* ImageData16x14*"),
    ("SlotGroupData", "SlotGroup", "ModulePdoGroup ModuleGroups!"),
    ("ModulePdoGroup", "Alignment RxPdo TxPdo", ""),
    ("Modules", "", "Module"),
    (
        "Module",
        "Crc32",
        "Type=ModuleType Name RxPdo=Pdo TxPdo=Pdo SafetyParaMapping* Mailbox=ModuleMailbox Profile DcOpModeName \
         Image16x14* ImageFile16x14* ImageData16x14* VendorSpecific*",
    ),
    ("ModuleType", "ModuleIdent ModuleClass ModulePdoGroup SRA_ParameterSupported", ""),
    ("ModuleMailbox", "", "AoE EoE CoE FoE SoE VoE* VendorSpecific*"),
];
